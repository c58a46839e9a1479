#include "krot/adjust/reprojection_cost.h"

#include <optional>
#include <stdexcept>

#include <Eigen/Geometry>

#include "krot/adjust/differentiated_pixel.h"
#include "krot/camera/camera_model.h"
#include "krot/geometry/rigid_transform.h"

namespace krot {
namespace {

using Eigen::Vector3d;
using Matrix23 = Eigen::Matrix<double, 2, 3>;

constexpr int kPoint = 0;
constexpr int kFrame = 1;
constexpr int kSensor = 2;

// [a]x, so that [a]x b = a x b.
Eigen::Matrix3d CrossMatrix(const Vector3d& a) {
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
  Eigen::Matrix<double, 3, 7> BlockJacobian(const Vector3d& x) const {
    const Vector3d v_x = v.cross(x);
    Eigen::Matrix<double, 3, 7> jacobian;
    jacobian.col(0) = 2 * v_x;
    jacobian.middleCols<3>(1) = -2 * (w * CrossMatrix(x) + CrossMatrix(v_x) +
                                      CrossMatrix(v) * CrossMatrix(x));
    jacobian.rightCols<3>().setIdentity();
    return jacobian;
  }

  double w;
  Vector3d v;
};

// Writes a Jacobian where Ceres asks for it, nowhere if `to` is null.
template <int kCols>
void StoreJacobian(const Eigen::Matrix<double, 2, kCols>& jacobian,
                   double* to) {
  if (to == nullptr) return;
  Eigen::Map<Eigen::Matrix<double, 2, kCols, Eigen::RowMajor>> block(to);
  block = jacobian;
}

}  // namespace

ReprojectionCost::ReprojectionCost(int camera_model, bool has_sensor,
                                   const Eigen::Vector2d& pixel)
    : pixel_(pixel), camera_model_(camera_model) {
  const CameraModelInfo* info = FindCameraModel(camera_model);
  if (info == nullptr) throw std::invalid_argument("unknown camera model");
  set_num_residuals(2);
  *mutable_parameter_block_sizes() = {3, 7};
  if (has_sensor) mutable_parameter_block_sizes()->push_back(7);
  mutable_parameter_block_sizes()->push_back(info->num_params);
}

bool ReprojectionCost::Evaluate(double const* const* blocks, double* residuals,
                                double** jacobians) const {
  const int camera = static_cast<int>(parameter_block_sizes().size()) - 1;
  const bool has_sensor = camera > kSensor;
  const Eigen::Map<const Vector3d> x_world(blocks[kPoint]);
  const BlockTransform rig_from_world(blocks[kFrame]);
  const Vector3d x_rig = rig_from_world * x_world;
  std::optional<BlockTransform> sensor_from_rig;
  if (has_sensor) sensor_from_rig.emplace(blocks[kSensor]);
  const Vector3d x_cam = has_sensor ? *sensor_from_rig * x_rig : x_rig;
  if (!(x_cam.z() > 0)) return false;

  const Eigen::Vector2d ray = x_cam.hnormalized();
  Eigen::Map<Eigen::Vector2d> residual(residuals);
  if (jacobians == nullptr) {
    residual = ProjectRay(camera_model_, blocks[camera], ray) - pixel_;
    return residual.allFinite();
  }
  const DifferentiatedPixel projected =
      DifferentiatePixel(camera_model_, blocks[camera], ray, jacobians[camera]);
  residual = projected.pixel - pixel_;
  Matrix23 J;  // by x_cam, then by x_rig
  J << projected.J_ray, -projected.J_ray * ray;
  J /= x_cam.z();
  if (has_sensor) {
    if (jacobians[kSensor] != nullptr) {
      StoreJacobian<7>(J * sensor_from_rig->BlockJacobian(x_rig),
                       jacobians[kSensor]);
    }
    J = J * sensor_from_rig->rotation;
  }
  StoreJacobian<3>(J * rig_from_world.rotation, jacobians[kPoint]);
  if (jacobians[kFrame] != nullptr) {
    StoreJacobian<7>(J * rig_from_world.BlockJacobian(x_world),
                     jacobians[kFrame]);
  }
  return residual.allFinite();
}

}  // namespace krot
