#pragma once

#include <cstdint>
#include <vector>

#include "krot/model.h"

namespace krot::internal {

// The points that each of `count` processes takes of a model, as indices of its
// points3D, ascending: consecutive ones in the order of their ids, with about
// as many observations. O(points log points).
std::vector<std::vector<int32_t>> CutPoints(const Model& whole, int count);

// All of a model but for the other points, their tracks, and the 2D points that
// no track here names.
struct ModelShare {
  Model model;
  // Per image: what its 2D points are called in the whole.
  std::vector<std::vector<uint32_t>> point2D_of;
};

// `points` as CutPoints gives them. Requires a valid model (ValidateModel).
ModelShare TakeShare(const Model& whole, const std::vector<int32_t>& points);

}  // namespace krot::internal
