#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/base/ranks.h"

namespace krot::internal {

// Least squares of bundle adjustment, in blocks of three columns: those of
// points, and those of frames or of whatever else points share.

// Which observation sees what. Observations stand in the order of their points.
struct BlockStructure {
  std::vector<int64_t> point_begin;  // num_points + 1
  std::vector<int32_t> frame_of;     // per observation
  std::vector<char> frame_is_fixed;  // per frame; a fixed one has no columns
  std::vector<char> point_is_fixed;  // per point, likewise; empty: none is

  bool IsFixedPoint(int64_t k) const {
    return !point_is_fixed.empty() && point_is_fixed[k] != 0;
  }
  int64_t num_points() const {
    return static_cast<int64_t>(point_begin.size()) - 1;
  }
  int64_t num_observations() const { return point_begin.back(); }
  int64_t num_frames() const {
    return static_cast<int64_t>(frame_is_fixed.size());
  }
};

// Each point's observations by frame, equal frames by observation: where those
// of point k stand from point_begin[k] on, relative to that.
std::vector<int32_t> OrderByFrame(const BlockStructure& structure);

// A number for every column.
struct BlockVector {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector3d> frames;

  void SetZero(int64_t num_points, int64_t num_frames) {
    points.assign(num_points, Eigen::Vector3d::Zero());
    frames.assign(num_frames, Eigen::Vector3d::Zero());
  }
  double Dot(const BlockVector& other) const;
  void Add(double factor, const BlockVector& other);  // += factor * other
};

// The 3x3 blocks that a symmetric matrix has, by its lower triangle: for each
// block column its block rows, ascending, beginning with the diagonal's.
struct BlockPattern {
  std::vector<int64_t> begin = {0};  // num_columns + 1
  std::vector<int32_t> row;          // per block

  int32_t num_columns() const { return static_cast<int32_t>(begin.size()) - 1; }
  int64_t num_blocks() const { return static_cast<int64_t>(row.size()); }
  bool operator==(const BlockPattern& other) const {
    return begin == other.begin && row == other.row;
  }
};

BlockPattern FullPattern(int32_t num_columns);

// The pairs of free frames that share a point, of any rank where ranks share
// the points. A block column stands for a free frame. O(sum of the squared
// lengths of tracks).
BlockPattern PairsThatSharePoints(const BlockStructure& structure,
                                  Ranks* ranks = nullptr);

// The sparse Cholesky factor of a matrix of this pattern, in Eigen's
// fill-reducing order, by a symbolic factorisation of one number per block:
// that takes next to nothing beside the factor itself.
struct SparseFactorSize {
  int64_t numbers;
  double operations;  // additions and multiplications that make it
};
SparseFactorSize FindSparseFactorSize(const BlockPattern& pattern);

}  // namespace krot::internal
