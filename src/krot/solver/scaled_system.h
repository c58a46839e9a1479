#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/solver/uncertain_system.h"

namespace krot {

// An uncertain system M a = -g times an invertible T, which changes no
// solution: T is a 3x3 block for every point and frame, chosen to make the
// blocks of H = T M M'T' on the diagonal, points eliminated for the frames',
// nearly the identity. Internal to the verification of supports.
struct ScaledSystem {
  using Real = long double;
  struct Columns {
    int32_t point = 0;
    int32_t frame = -1;  // -1: none
    UncertainSystem::Block point_rows;
    UncertainSystem::Block frame_rows;
  };
  size_t num_points = 0;
  size_t num_frames = 0;
  std::vector<Columns> columns;  // of T M, in the order of their points
  Real matrix_error = 0;         // Frobenius norm of what T M is not known by
  Real bound_length = 0;         // of |T g|
};

// None if there is no such T: a point or frame is free to move, or numbers are
// not finite. Products and bounds account for all roundings. O(columns).
std::optional<ScaledSystem> ScaleBlocks(const UncertainSystem& system);

// Calls visit(begin, end) for the columns of every point, until one returns
// false. Whether none did and every point had columns.
template <typename Columns, typename Visit>
bool ForPoints(const std::vector<Columns>& columns, size_t num_points,
               const Visit& visit) {
  size_t num_seen = 0;
  for (size_t begin = 0; begin < columns.size();) {
    size_t end = begin;
    while (end < columns.size() && columns[end].point == columns[begin].point) {
      ++end;
    }
    ++num_seen;
    if (!visit(begin, end)) return false;
    begin = end;
  }
  return num_seen == num_points;
}

}  // namespace krot
