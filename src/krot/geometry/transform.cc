#include "krot/geometry/transform.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include <Eigen/LU>
#include <Eigen/SVD>

#include "krot/base/numbers.h"
#include "krot/geometry.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// Maps centres `after` to `before`.
struct CommonMove {
  double scale = 1;
  Vector3d shift = Vector3d::Zero();

  double Residual(const CameraMove& camera) const {
    return (camera.before - (scale * camera.after + shift)).norm();
  }
};

CommonMove MedianMove(const std::vector<CameraMove>& cameras, double scale) {
  CommonMove move;
  move.scale = scale;
  std::vector<Vector3d> shifts;
  for (const CameraMove& camera : cameras) {
    shifts.push_back(camera.before - scale * camera.after);
  }
  move.shift = MedianPlace(shifts);
  return move;
}

// Of the centres, before or after, of the cameras that count.
struct Spread {
  double count = 0;
  Vector3d centroid = Vector3d::Zero();
  double square = 0;  // the sum of the squared distances from the centroid
};

Spread SpreadOf(const std::vector<CameraMove>& cameras,
                const std::vector<char>& counts,
                const Vector3d CameraMove::*centre) {
  Spread spread;
  for (size_t n = 0; n < cameras.size(); ++n) {
    if (counts[n] == 0) continue;
    spread.count += 1;
    spread.centroid += cameras[n].*centre;
  }
  spread.centroid /= spread.count;
  for (size_t n = 0; n < cameras.size(); ++n) {
    if (counts[n] == 0) continue;
    spread.square += (cameras[n].*centre - spread.centroid).squaredNorm();
  }
  return spread;
}

// The move between the centroids; if the scale is free, it also makes the RMS
// distances from them equal.
CommonMove MoveOf(const Spread& before, const Spread& after,
                  bool scale_is_free) {
  CommonMove move;
  if (scale_is_free && before.square > 0 && after.square > 0) {
    move.scale = std::sqrt(before.square / after.square);
  }
  move.shift = before.centroid - move.scale * after.centroid;
  return move;
}

}  // namespace

Eigen::Matrix3d CrossMatrix(const Vector3d& a) {
  Eigen::Matrix3d matrix;
  matrix << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return matrix;
}

Vector3d MedianPlace(const std::vector<Vector3d>& places) {
  Vector3d median;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Vector3d& place : places) values.push_back(place[axis]);
    median[axis] = LowerMedian(std::move(values));
  }
  return median;
}

double MedianDistance(const std::vector<Vector3d>& places,
                      const Vector3d& from) {
  std::vector<double> distances;
  for (const Vector3d& place : places) {
    distances.push_back((place - from).norm());
  }
  return distances.empty() ? 0 : Median(std::move(distances));
}

std::vector<char> FindConsensus(const std::vector<CameraMove>& cameras,
                                bool scale_is_free) {
  std::vector<char> keeps(cameras.size(), 1);
  std::vector<double> distances;
  std::vector<double> scales;
  for (const CameraMove& camera : cameras) {
    const double scale = camera.distance_before / camera.distance_after;
    if (!std::isfinite(scale) || !(scale > 0)) continue;
    distances.push_back(camera.distance_before);
    scales.push_back(scale);
  }
  if (cameras.size() < 3 || 2 * scales.size() < cameras.size()) return keeps;

  const double distance = LowerMedian(std::move(distances));
  CommonMove move =
      MedianMove(cameras, scale_is_free ? LowerMedian(std::move(scales)) : 1);
  // The common move depends on which cameras keep their place, and the other
  // way round, so they are found in turn.
  Spread before = SpreadOf(cameras, keeps, &CameraMove::before);
  for (int round = 0; round < 3; ++round) {
    std::vector<double> residuals;
    for (const CameraMove& camera : cameras) {
      residuals.push_back(move.Residual(camera));
    }
    // If many cameras move a lot, as from a rough start, there are no runaways.
    const double far =
        std::min(distance, std::sqrt(before.square / before.count));
    const double allowed = std::max(far, 10 * LowerMedian(residuals));
    std::vector<char> now;
    for (const double residual : residuals) now.push_back(residual <= allowed);
    if (round > 0 && now == keeps) break;
    keeps = std::move(now);
    before = SpreadOf(cameras, keeps, &CameraMove::before);
    move = MoveOf(before, SpreadOf(cameras, keeps, &CameraMove::after),
                  scale_is_free);
  }
  return keeps;
}

void NearestPoint::Add(const Eigen::Vector3d& point,
                       const Eigen::Vector3d& direction, double weight) {
  const Eigen::Matrix3d across = weight * (Eigen::Matrix3d::Identity() -
                                           direction * direction.transpose());
  normal_ += across;
  right_side_ += across * point;
}

std::optional<Eigen::Vector3d> NearestPoint::Solve() const {
  const Eigen::FullPivLU<Eigen::Matrix3d> decomposition(normal_);
  if (!decomposition.isInvertible()) return std::nullopt;
  return decomposition.solve(right_side_);
}

}  // namespace krot::internal

namespace krot {

using namespace internal;

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

RigidTransform operator*(const RigidTransform& a_from_b,
                         const RigidTransform& b_from_c) {
  return {a_from_b.rotation * b_from_c.rotation,
          a_from_b * b_from_c.translation};
}

RigidTransform Inverse(const RigidTransform& b_from_a) {
  const Matrix3d rotation = b_from_a.rotation.transpose();
  return {rotation, -rotation * b_from_a.translation};
}

Vector3d Center(const RigidTransform& cam_from_world) {
  return -cam_from_world.rotation.transpose() * cam_from_world.translation;
}

Vector3d Similarity::operator*(const Vector3d& x) const {
  return scale * (rotation * x) + translation;
}

Matrix3d Ellipsoid::UnitFromWorld() const {
  return semi_axes.cwiseInverse().asDiagonal() *
         world_from_axes.normalized().toRotationMatrix().transpose();
}

Quaterniond NormalizedQuaternion(const QuaternionWxyz& wxyz) {
  const Quaterniond q(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  // The squared norm of a normalised quaternion is 1 up to the rounding of four
  // squares and a division, half a unit in the last place each.
  const bool is_normalized = std::abs(q.squaredNorm() - 1) <=
                             4 * std::numeric_limits<double>::epsilon();
  return is_normalized ? q : q.normalized();
}

QuaternionWxyz ToWxyz(const Quaterniond& q) {
  return {q.w(), q.x(), q.y(), q.z()};
}

bool HasRotation(const QuaternionWxyz& wxyz) {
  const double squared_norm =
      Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).squaredNorm();
  return squared_norm > 0 && std::isfinite(squared_norm);
}

Matrix3d RotationOf(const QuaternionWxyz& wxyz) {
  if (!HasRotation(wxyz)) {
    return Matrix3d::Constant(kNaN);
  }
  return NormalizedQuaternion(wxyz).toRotationMatrix();
}

std::optional<Matrix3d> NearestRotation(const Matrix3d& M) {
  const Eigen::JacobiSVD<Matrix3d> svd(
      M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Matrix3d& U = svd.matrixU();
  const Matrix3d& V = svd.matrixV();
  const double sign = (U * V.transpose()).determinant() < 0 ? -1 : 1;
  const Vector3d& values = svd.singularValues();
  if (!(values[1] + sign * values[2] > 1e-9 * values[0])) {
    return std::nullopt;  // it is not unique
  }
  return U * Vector3d(1, 1, sign).asDiagonal() * V.transpose();
}

}  // namespace krot
