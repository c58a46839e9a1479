#pragma once

#include <ceres/sized_cost_function.h>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "krot/adjust/differentiated_pixel.h"
#include "krot/geometry/rigid_transform.h"

namespace krot {

// [a]x, so that [a]x b = a x b.
inline Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& a) {
  Eigen::Matrix3d matrix;
  matrix << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return matrix;
}

// x -> R(q) x + t for a block qw qx qy qz tx ty tz of unit quaternion, with
//   R(q) x = x + 2 w (v x x) + 2 v x (v x x),  q = (w, v).
struct BlockTransform : RigidTransform {
  explicit BlockTransform(const double* block)
      : RigidTransform{Eigen::Quaterniond(block[0], block[1], block[2],
                                          block[3])
                           .toRotationMatrix(),
                       {block[4], block[5], block[6]}},
        w(block[0]),
        v(block[1], block[2], block[3]) {}

  // d (R(q) x + t) / d block.
  Eigen::Matrix<double, 3, 7> BlockJacobian(const Eigen::Vector3d& x) const {
    const Eigen::Vector3d v_x = v.cross(x);
    Eigen::Matrix<double, 3, 7> jacobian;
    jacobian.col(0) = 2 * v_x;
    jacobian.middleCols<3>(1) = -2 * (w * CrossMatrix(x) + CrossMatrix(v_x) +
                                      CrossMatrix(v) * CrossMatrix(x));
    jacobian.rightCols<3>().setIdentity();
    return jacobian;
  }

  double w;
  Eigen::Vector3d v;
};

// Writes a Jacobian where Ceres asks for it, nowhere if `to` is null.
template <int kCols>
void StoreJacobian(const Eigen::Matrix<double, 2, kCols>& jacobian,
                   double* to) {
  if (to == nullptr) return;
  Eigen::Map<Eigen::Matrix<double, 2, kCols, Eigen::RowMajor>> block(to);
  block = jacobian;
}

// Reprojection error, projected minus measured, in pixels. Blocks: point (3),
// rig_from_world (7), sensor_from_rig (7; only if kHasSensor), camera.
//
//   x_cam = sensor_from_rig (rig_from_world x)
//
// Evaluation fails, and Ceres rejects the step, where x_cam is not in front of
// the camera or has no finite pixel.
template <typename Camera, bool kHasSensor>
struct ReprojectionCostBase;
template <typename Camera>
struct ReprojectionCostBase<Camera, true> {
  using Type = ceres::SizedCostFunction<2, 3, 7, 7, Camera::kNumParams>;
};
template <typename Camera>
struct ReprojectionCostBase<Camera, false> {
  using Type = ceres::SizedCostFunction<2, 3, 7, Camera::kNumParams>;
};

template <typename Camera, bool kHasSensor>
class ReprojectionCost final
    : public ReprojectionCostBase<Camera, kHasSensor>::Type {
 public:
  explicit ReprojectionCost(const Eigen::Vector2d& pixel) : pixel_(pixel) {}

  bool Evaluate(double const* const* blocks, double* residuals,
                double** jacobians) const override {
    const Eigen::Map<const Eigen::Vector3d> x_world(blocks[kPoint]);
    const BlockTransform rig_from_world(blocks[kFrame]);
    const Eigen::Vector3d x_rig = rig_from_world * x_world;
    if constexpr (kHasSensor) {
      const BlockTransform sensor_from_rig(blocks[kSensor]);
      const Eigen::Vector3d x_cam = sensor_from_rig * x_rig;
      Matrix23 J_cam;
      if (!ProjectPoint(x_cam, blocks, residuals, jacobians, &J_cam)) {
        return false;
      }
      if (jacobians == nullptr) return true;
      if (jacobians[kSensor] != nullptr) {
        StoreJacobian<7>(J_cam * sensor_from_rig.BlockJacobian(x_rig),
                         jacobians[kSensor]);
      }
      const Matrix23 J_rig = J_cam * sensor_from_rig.rotation;
      ChainToWorld(rig_from_world, x_world, J_rig, jacobians);
    } else {
      Matrix23 J_rig;
      if (!ProjectPoint(x_rig, blocks, residuals, jacobians, &J_rig)) {
        return false;
      }
      if (jacobians == nullptr) return true;
      ChainToWorld(rig_from_world, x_world, J_rig, jacobians);
    }
    return true;
  }

 private:
  using Matrix23 = Eigen::Matrix<double, 2, 3>;
  static constexpr int kPoint = 0;
  static constexpr int kFrame = 1;
  static constexpr int kSensor = 2;
  static constexpr int kCamera = kHasSensor ? 3 : 2;

  // The residuals; if `jacobians` are wanted, theirs by the camera's parameters
  // and by x_cam.
  bool ProjectPoint(const Eigen::Vector3d& x_cam, double const* const* blocks,
                    double* residuals, double** jacobians,
                    Matrix23* J_cam) const {
    if (!(x_cam.z() > 0)) return false;
    const double* params = blocks[kCamera];
    const Eigen::Vector2d ray = x_cam.hnormalized();
    Eigen::Map<Eigen::Vector2d> residual(residuals);
    if (jacobians == nullptr) {
      Camera::Project(params, ray.x(), ray.y(), &residual.x(), &residual.y());
      residual -= pixel_;
      return residual.allFinite();
    }
    const bool wants_params = jacobians[kCamera] != nullptr;
    const DifferentiatedPixel<Camera> projected(params, ray, wants_params);
    residual = projected.pixel - pixel_;
    if (wants_params) StoreJacobian(projected.J_params, jacobians[kCamera]);
    *J_cam << projected.J_ray, -projected.J_ray * ray;
    *J_cam /= x_cam.z();
    return residual.allFinite();
  }

  static void ChainToWorld(const BlockTransform& rig_from_world,
                           const Eigen::Vector3d& x_world,
                           const Matrix23& J_rig, double** jacobians) {
    StoreJacobian<3>(J_rig * rig_from_world.rotation, jacobians[kPoint]);
    if (jacobians[kFrame] != nullptr) {
      StoreJacobian<7>(J_rig * rig_from_world.BlockJacobian(x_world),
                       jacobians[kFrame]);
    }
  }

  Eigen::Vector2d pixel_;
};

}  // namespace krot
