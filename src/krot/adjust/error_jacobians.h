#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/adjustment_columns.h"

namespace krot {

// The derivatives D of (error x, error y, depth) of every observation, 3x3 by
// its point and by each block of columns that it depends on:
//
//   x_cam = R_s d_s,  d_s = x_rig - c_s,  x_rig = R_f d_f,  d_f = x - c_f
//
// with R exp([theta]x) in place of R (AdjustmentColumns::Pose).
class ErrorJacobians {
 public:
  // Keeps a reference to `columns`. Of the blocks only the observations count.
  ErrorJacobians(const AdjustmentColumns& columns,
                 const AdjustmentBlocks& blocks);

  // At blocks of the same observations, whose points are in front of their
  // cameras.
  void Evaluate(const AdjustmentBlocks& blocks, int num_threads);

  const Eigen::Matrix3d& by_point(int64_t i) const { return D_[begin_[i]]; }
  // Of blocks(i)[n]; that of the cap, which comes last, is 0.
  const Eigen::Matrix3d& by_block(int64_t i, int n) const {
    return D_[begin_[i] + 1 + n];
  }
  // Ascending.
  const int32_t* blocks(int64_t i) const {
    return blocks_.data() + begin_[i] + 1;
  }
  int num_blocks(int64_t i) const {
    return static_cast<int>(begin_[i + 1] - begin_[i] - 1);
  }

 private:
  const AdjustmentColumns& columns_;
  std::vector<int64_t> begin_;   // num_observations + 1
  std::vector<int32_t> blocks_;  // kHeld for a point
  std::vector<Eigen::Matrix3d> D_;
};

}  // namespace krot
