#pragma once

#include <cstdint>
#include <vector>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/adjustment_columns.h"
#include "krot/adjust/reprojection_errors.h"
#include "krot/linear/ordered_sums.h"
#include "krot/linear/schur_complement.h"

namespace krot {

// The observations of every point, and the blocks of columns that they depend
// on.
class AdjustmentTracks {
 public:
  AdjustmentTracks(const ErrorJacobians& jacobians,
                   const AdjustmentBlocks& blocks, int32_t num_blocks);

  int64_t begin(int64_t k) const { return observation_begin_[k]; }
  int64_t end(int64_t k) const { return observation_begin_[k + 1]; }

  // Every block of the point once, ascending.
  const int32_t* blocks_begin(int64_t k) const {
    return structure_.frame_of.data() + structure_.point_begin[k];
  }
  const int32_t* blocks_end(int64_t k) const {
    return structure_.frame_of.data() + structure_.point_begin[k + 1];
  }
  // Where among these ErrorJacobians::blocks(i) stand.
  const int32_t* slots(int64_t i) const {
    return slots_.data() + slot_begin_[i];
  }

  // The same for a FrameSystem, with blocks for frames.
  const BlockStructure& structure() const { return structure_; }

 private:
  std::vector<int64_t> observation_begin_;  // num_points + 1
  BlockStructure structure_;
  std::vector<int64_t> slot_begin_;  // by observation
  std::vector<int32_t> slots_;
};

// The slack of an error below the cap.
inline double Slack(double cap2, double squared_error) {
  return (cap2 - squared_error) / 2;
}

// Newton's system of bounded bundle adjustment,
//
//   min sum |r|^2 / 2 - mu sum log(h) + cap_weight cap2 / 2,
//   h = (cap2 - |r|^2) / 2,
//
// at an iterate with multipliers lambda of h >= 0. An observation with depth w
// and derivatives D of (r, w), error_jacobians.h, has the rows of least squares
//
//   K D,   K = [ sqrt(1 + lambda) I2                             ]
//              [ sqrt(lambda / h) r'     -sqrt(lambda / h) h / w ]
//
// and by cap2 -sqrt(lambda / h) / 2 in the third: rows' rows is the
// primal-dual method's matrix [Nocedal, Wright 2006, Sec. 19.3] for the
// constraint w h >= 0, at w fixed where it scales the multiplier. In
// translations and points w r and w are affine, so that the curvature of w^2 h
// is -J'J alone, J = dr: dw takes the place of the second derivatives of r,
// without which steps along a cap of large multipliers are short.
//
// The points are eliminated; the "frames" of what is left are the blocks of
// three columns of AdjustmentColumns. The gauge is free, so the diagonal is
// raised by its share 1 / radius.
class BarrierSystem {
 public:
  // Keeps a reference to `columns`.
  BarrierSystem(const AdjustmentColumns& columns,
                const AdjustmentBlocks& blocks, int num_threads);

  // Takes the system at an iterate: `errors` and `multipliers` must outlive the
  // calls below. The errors are below the cap.
  void Linearize(const AdjustmentBlocks& blocks,
                 const std::vector<ProjectedError>& errors,
                 const std::vector<double>& multipliers);
  // False if there is no factor.
  bool Factorize(double radius);

  // Newton's direction.
  void Solve(double mu, double cap_weight);

  // Where that leads, also in terms of (r, w).
  struct Direction {
    BlockVector unknowns;
    std::vector<Eigen::Vector3d> slopes;
  };
  const Direction& direction() const { return direction_; }
  double cap2_slope() const;

  // g' D^-1 g / 2 of the last Solve, with g the gradient of what is minimised
  // and D the diagonal of the system: what the unknowns would gain, each moved
  // by itself.
  double SingleGains() const;

  const ObservationLoop& loop() const { return loop_; }
  ReducedCameraSystem::Kind kind() const { return schur_.reduced().kind(); }

 private:
  double SlackOf(int64_t i) const {
    return Slack(cap2_, (*errors_)[i].r.squaredNorm());
  }
  // K D by point and blocks; the number of these.
  int Rows(int64_t i, Eigen::Matrix3d* by_point,
           Eigen::Matrix3d* by_block) const;
  // K'K (dr; dw), with that by cap2 behind it.
  Eigen::Vector4d Weigh(int64_t i, const Eigen::Vector3d& change,
                        double cap2_change) const;

  void AddPoint(int64_t k, double damping, int part);
  void ReducePoint(int64_t k, int part, double* rhs);
  void BackSubstitute(int64_t k);
  bool MovesCap() const { return columns_.cap != AdjustmentColumns::kHeld; }

  const AdjustmentColumns& columns_;
  const ObservationLoop loop_;
  ErrorJacobians jacobians_;
  const AdjustmentTracks tracks_;
  SchurComplement schur_;

  const std::vector<ProjectedError>* errors_ = nullptr;
  const std::vector<double>* multipliers_ = nullptr;
  double cap2_ = 0;
  double mu_ = 0;
  std::vector<Eigen::Matrix3d> L_inverse_;  // of points, H = L L'
  BlockVector diagonal_;
  BlockVector gradient_;
  Direction direction_;
  // Of the blocks, by part of the sum.
  std::vector<std::vector<Eigen::Vector3d>> part_diagonal_, part_gradient_;
};

}  // namespace krot
