#pragma once

#include <cmath>
#include <memory>
#include <utility>

#include <ceres/cost_function.h>
#include <ceres/sized_cost_function.h>
#include <Eigen/Core>

#include "krot/adjust/reprojection_cost.h"

namespace krot {

// What all observations of a bounded adjustment share. It minimises
//
//   sum |r|^2 / 2 - mu sum log(h) + cap_weight cap2 / 2,
//   h = (cap2 - |r|^2) / 2, positive below the cap.
struct Barrier {
  double mu = 0;          // pixels^2
  double cap_weight = 0;  // 0 where the cap stays as it is
};

inline double Slack(double cap2, double squared_error) {
  return (cap2 - squared_error) / 2;
}

// The depth w of a point with its derivatives by the blocks point, frame,
// [sensor,] camera.
class DepthGradient {
 public:
  DepthGradient(double const* const* blocks, bool has_sensor)
      : x_world_(blocks[0]), rig_from_world_(blocks[1]) {
    const Eigen::Vector3d x_rig = rig_from_world_ * x_world_;
    by_rig_ = Eigen::RowVector3d::UnitZ();
    depth_ = x_rig.z();
    if (!has_sensor) return;
    const BlockTransform sensor_from_rig(blocks[2]);
    by_rig_ = sensor_from_rig.rotation.row(2);
    by_sensor_ = sensor_from_rig.BlockJacobian(x_rig).row(2);
    has_sensor_ = true;
    depth_ = (sensor_from_rig * x_rig).z();
  }

  double depth() const { return depth_; }

  // Subtracts `scale` times the derivatives by a block from `row`.
  void Subtract(double scale, size_t block, double* row) const {
    if (block == 0) {
      Eigen::Map<Eigen::RowVector3d>(row) -=
          scale * by_rig_ * rig_from_world_.rotation;
    } else if (block == 1) {
      Eigen::Map<RowVector7d>(row) -=
          scale * by_rig_ * rig_from_world_.BlockJacobian(x_world_);
    } else if (block == 2 && has_sensor_) {
      Eigen::Map<RowVector7d>(row) -= scale * by_sensor_;
    }
  }

 private:
  using RowVector7d = Eigen::Matrix<double, 1, 7>;

  Eigen::Map<const Eigen::Vector3d> x_world_;
  BlockTransform rig_from_world_;
  double depth_ = 0;
  Eigen::RowVector3d by_rig_;  // dw / dx_rig
  bool has_sensor_ = false;
  RowVector7d by_sensor_;
};

// Newton's system for one reprojection error r with the barrier cost
//
//   |r|^2 / 2 - mu log(h)
//
// as three rows of linear least squares, for which Ceres finds the step. With
// J = dr, w the depth and lambda the multiplier of h >= 0,
//
//   sqrt(1 + lambda) J                       (1 + mu / h) / sqrt(1 + lambda) r
//   sqrt(lambda / h) (r'J - (h / w) dw - dcap2 / 2)      0
//
// so that rows' residuals = (1 + mu / h) J'r, the gradient but for that by the
// cap, which is CapCost's, and rows' rows is
// the primal-dual method's matrix [Nocedal, Wright 2006, Sec. 19.3] for the
// constraint w h >= 0 at w fixed where it scales the multiplier. In
// translations and points w r and w are affine, so that the curvature of w^2 h
// is -J'J alone: dw takes the place of the second derivatives of r, without
// which steps along a cap of large multipliers are short.
class BarrierCost final : public ceres::CostFunction {
 public:
  // `projection` has the blocks point, frame, [sensor,] camera; this one has
  // cap2 behind them.
  BarrierCost(std::unique_ptr<ceres::CostFunction> projection,
              const Barrier* barrier, const double* multiplier)
      : projection_(std::move(projection)),
        barrier_(*barrier),
        multiplier_(*multiplier) {
    *mutable_parameter_block_sizes() = projection_->parameter_block_sizes();
    mutable_parameter_block_sizes()->push_back(1);
    set_num_residuals(kNumRows);
  }

  // Fails without Jacobians: there is no cost to the rows, and a step of
  // Ceres' is never taken as it is.
  bool Evaluate(double const* const* blocks, double* residuals,
                double** jacobians) const override {
    if (jacobians == nullptr) return false;
    if (!projection_->Evaluate(blocks, residuals, jacobians)) return false;
    Eigen::Map<Eigen::Vector2d> r(residuals);
    const size_t cap = parameter_block_sizes().size() - 1;
    const double h = Slack(*blocks[cap], r.squaredNorm());
    const DepthGradient depth(blocks, HasSensor());
    const double curvature = std::sqrt(1 + multiplier_);
    const double row_scale = std::sqrt(multiplier_ / h);
    for (size_t b = 0; b < cap; ++b) {
      if (jacobians[b] == nullptr) continue;
      const int size = parameter_block_sizes()[b];
      Eigen::Map<RowMajorMatrix> J(jacobians[b], kNumRows, size);
      J.row(2) = r.transpose() * J.topRows<2>();
      depth.Subtract(h / depth.depth(), b, jacobians[b] + 2 * size);
      J.row(2) *= row_scale;
      J.topRows<2>() *= curvature;
    }
    if (jacobians[cap] != nullptr) {
      Eigen::Map<Eigen::Vector3d>(jacobians[cap]) << 0, 0, -row_scale / 2;
    }
    r *= (1 + barrier_.mu / h) / curvature;
    residuals[2] = 0;
    return true;
  }

 private:
  using RowMajorMatrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  static constexpr int kNumRows = 3;

  bool HasSensor() const { return parameter_block_sizes().size() == 5; }

  std::unique_ptr<ceres::CostFunction> projection_;
  const Barrier& barrier_;
  const double& multiplier_;
};

// The derivative of the barrier cost by cap2, as one row of that system.
struct CapSlope {
  double slope = 0;      // by cap2
  double curvature = 0;  // what BarrierCosts give its square; > 0
};
class CapCost final : public ceres::SizedCostFunction<1, 1> {
 public:
  explicit CapCost(const CapSlope* cap) : cap_(*cap) {}

  // Fails without Jacobians, as BarrierCost does.
  bool Evaluate(double const* const* /*blocks*/, double* residuals,
                double** jacobians) const override {
    if (jacobians == nullptr) return false;
    const double row = std::sqrt(kCurvatureShare * cap_.curvature);
    residuals[0] = cap_.slope / row;
    if (jacobians[0] != nullptr) jacobians[0][0] = row;
    return true;
  }

 private:
  // What the row itself adds to the curvature is next to nothing.
  static constexpr double kCurvatureShare = 1e-8;

  const CapSlope& cap_;
};

}  // namespace krot
