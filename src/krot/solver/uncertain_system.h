#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace krot {

// An under-determined system M a = -g with the structure of bundle adjustment,
// that is known approximately. Its rows come in threes, for points and for
// frames; its columns in twos, for observations, each of which meets the rows
// of one point and of at most one frame. Entry by entry, the true matrix is
// within the errors of M and the true |g| within its bound.
struct UncertainSystem {
  using Block = Eigen::Matrix<long double, 3, 2>;
  using BlockError = Eigen::Matrix<double, 3, 2>;
  struct Columns {
    int32_t point = 0;
    int32_t frame = -1;  // -1: none
    Block point_rows = Block::Zero();
    Block frame_rows = Block::Zero();
    BlockError point_error = BlockError::Zero();  // >= 0
    BlockError frame_error = BlockError::Zero();
  };
  std::vector<Columns> columns;              // in the order of their points
  std::vector<Eigen::Vector3d> point_bound;  // of |g|, >= 0; one per point
  std::vector<Eigen::Vector3d> frame_bound;

  int64_t num_rows() const {
    return 3 * static_cast<int64_t>(point_bound.size() + frame_bound.size());
  }
  int64_t num_columns() const {
    return 2 * static_cast<int64_t>(columns.size());
  }
};

}  // namespace krot
