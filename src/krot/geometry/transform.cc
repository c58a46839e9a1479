#include "krot/geometry/transform.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include <Eigen/SVD>

#include "krot/base/numbers.h"
#include "krot/geometry.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// A runaway moves by more than this times the median move. If many cameras move
// a lot, as from a rough start, there are no runaways.
constexpr double kTypicalMoves = 10;
// The common move depends on which cameras keep their place, and the other way
// round, so they are found in turn, this often at most.
constexpr int kMaxRounds = 3;

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

// The move between the centroids of the cameras that count; if the scale is
// free, it also makes the RMS distances from them equal.
CommonMove MoveOf(const std::vector<CameraMove>& cameras,
                  const std::vector<char>& counts, bool scale_is_free) {
  double count = 0;
  Vector3d before = Vector3d::Zero();
  Vector3d after = Vector3d::Zero();
  for (size_t n = 0; n < cameras.size(); ++n) {
    if (counts[n] == 0) continue;
    count += 1;
    before += cameras[n].before;
    after += cameras[n].after;
  }
  before /= count;
  after /= count;
  double square_before = 0;
  double square_after = 0;
  for (size_t n = 0; n < cameras.size(); ++n) {
    if (counts[n] == 0) continue;
    square_before += (cameras[n].before - before).squaredNorm();
    square_after += (cameras[n].after - after).squaredNorm();
  }
  CommonMove move;
  if (scale_is_free && square_before > 0 && square_after > 0) {
    move.scale = std::sqrt(square_before / square_after);
  }
  move.shift = before - move.scale * after;
  return move;
}

// The RMS distance of the cameras that count from their centroid, before.
double Radius(const std::vector<CameraMove>& cameras,
              const std::vector<char>& counts) {
  double count = 0;
  Vector3d sum = Vector3d::Zero();
  for (size_t n = 0; n < cameras.size(); ++n) {
    if (counts[n] == 0) continue;
    count += 1;
    sum += cameras[n].before;
  }
  const Vector3d centroid = sum / count;
  double square = 0;
  for (size_t n = 0; n < cameras.size(); ++n) {
    if (counts[n] == 0) continue;
    square += (cameras[n].before - centroid).squaredNorm();
  }
  return std::sqrt(square / count);
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
  for (int round = 0; round < kMaxRounds; ++round) {
    std::vector<double> residuals;
    for (const CameraMove& camera : cameras) {
      residuals.push_back(move.Residual(camera));
    }
    const double far = std::min(distance, Radius(cameras, keeps));
    const double allowed =
        std::max(far, kTypicalMoves * LowerMedian(residuals));
    std::vector<char> now;
    for (const double residual : residuals) now.push_back(residual <= allowed);
    if (round > 0 && now == keeps) break;
    keeps = std::move(now);
    move = MoveOf(cameras, keeps, scale_is_free);
  }
  return keeps;
}

}  // namespace krot::internal

namespace krot {

using namespace internal;

namespace {

using Eigen::Quaterniond;

using Eigen::Matrix3d;
using Eigen::Vector3d;

// The nearest rotation is unique if the sum of the two smallest singular
// values, with the sign of the last one, exceeds this times the largest.
constexpr double kNotUnique = 1e-9;
// The squared norm of a normalised quaternion is 1 up to this: the rounding of
// four squares and a division, half a unit in the last place each.
constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon();

}  // namespace

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
  return std::abs(q.squaredNorm() - 1) <= kRounding ? q : q.normalized();
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
    return Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN());
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
  if (!(values[1] + sign * values[2] > kNotUnique * values[0])) {
    return std::nullopt;
  }
  return U * Vector3d(1, 1, sign).asDiagonal() * V.transpose();
}

}  // namespace krot
