#include "krot/analysis/alignment.h"

#include <algorithm>
#include <cmath>

#include "krot/base/numbers.h"
#include "krot/geometry.h"
#include "krot/geometry/consensus.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

Matrix3Xd Centers(const std::vector<PosePair>& poses,
                  Vector3d PosePair::*center) {
  Matrix3Xd centers(3, poses.size());
  for (size_t n = 0; n < poses.size(); ++n) centers.col(n) = poses[n].*center;
  return centers;
}

double Radius(const Matrix3Xd& centers) {
  if (centers.cols() == 0) return 0;
  const Vector3d centroid = centers.rowwise().mean();
  return (centers.colwise() - centroid).norm() /
         std::sqrt(static_cast<double>(centers.cols()));
}

// The chordal mean of R1' R2.
std::optional<Matrix3d> MeanRotation(const std::vector<PosePair>& poses) {
  Matrix3d sum = Matrix3d::Zero();
  for (const PosePair& pose : poses) {
    sum += pose.cam_from_world1_rotation.transpose() *
           pose.cam_from_world2_rotation;
  }
  return NearestRotation(sum);
}

bool AreEqual(const PosePair& pose) {
  return pose.cam_from_world1_rotation == pose.cam_from_world2_rotation &&
         pose.center1 == pose.center2;
}

bool IsIdentity(const Similarity& similarity) {
  return similarity.scale == 1 && similarity.rotation == Matrix3d::Identity() &&
         similarity.translation == Vector3d::Zero();
}

// Camera coordinates grow with the world: scale (R x2 + t) = R' x1 + t'.
void Transform(const Similarity& world1_from_world2, Pose* cam_from_world) {
  const Eigen::Quaterniond rotated =
      NormalizedQuaternion(cam_from_world->quaternion_wxyz) *
      Eigen::Quaterniond(world1_from_world2.rotation).conjugate();
  cam_from_world->quaternion_wxyz = ToWxyz(rotated);
  cam_from_world->translation =
      world1_from_world2.scale * cam_from_world->translation -
      rotated * world1_from_world2.translation;
}

}  // namespace

double AngleDeg(const Matrix3d& A, const Matrix3d& B) {
  // The chord |A - B|_F = 2 sqrt(2) sin(angle / 2): the trace is blind to
  // small angles.
  const double sine = (A - B).norm() / std::sqrt(8.0);
  return 2 * std::asin(std::min(1.0, sine)) * kDegreesPerRadian;
}

std::vector<PosePair> HeldPoses(const std::vector<PosePair>& poses) {
  const std::optional<Matrix3d> rotation = MeanRotation(poses);
  if (!rotation) return poses;
  std::vector<CameraMove> cameras;
  for (const PosePair& pose : poses) {
    cameras.push_back({pose.center1, *rotation * pose.center2, pose.distance1,
                       pose.distance2});
  }
  const std::vector<char> keeps =
      FindConsensus(cameras, /*scale_is_free=*/true);
  std::vector<PosePair> held;
  for (size_t n = 0; n < keeps.size(); ++n) {
    if (keeps[n] != 0) held.push_back(poses[n]);
  }
  return held;
}

double SceneRadius(const std::vector<PosePair>& poses) {
  return Radius(Centers(poses, &PosePair::center1));
}

std::optional<Similarity> AlignFrames(const std::vector<PosePair>& poses) {
  if (poses.empty()) return std::nullopt;
  const std::vector<PosePair> held = HeldPoses(poses);
  const std::optional<Matrix3d> rotation = MeanRotation(held);
  if (!rotation) return std::nullopt;

  const Matrix3Xd centers1 = Centers(held, &PosePair::center1);
  const Matrix3Xd centers2 = Centers(held, &PosePair::center2);
  const double radius1 = Radius(centers1);
  const double radius2 = Radius(centers2);
  Similarity similarity;
  similarity.rotation = *rotation;
  if (radius1 > 0 && radius2 > 0) similarity.scale = radius1 / radius2;
  similarity.translation =
      centers1.rowwise().mean() -
      similarity.scale * (*rotation * centers2.rowwise().mean());
  return similarity;
}

std::optional<Similarity> AlignCenters(const std::vector<PosePair>& poses) {
  if (poses.size() < 3) return std::nullopt;
  const double count = static_cast<double>(poses.size());
  Vector3d mean1 = Vector3d::Zero();
  Vector3d mean2 = Vector3d::Zero();
  for (const PosePair& pose : poses) {
    mean1 += pose.center1 / count;
    mean2 += pose.center2 / count;
  }
  Matrix3d covariance = Matrix3d::Zero();
  double variance2 = 0;
  for (const PosePair& pose : poses) {
    const Vector3d offset2 = pose.center2 - mean2;
    covariance += (pose.center1 - mean1) * offset2.transpose();
    variance2 += offset2.squaredNorm();
  }
  const std::optional<Matrix3d> rotation = NearestRotation(covariance);
  if (!rotation) return std::nullopt;
  Similarity similarity;
  similarity.rotation = *rotation;
  similarity.scale = rotation->cwiseProduct(covariance).sum() / variance2;
  similarity.translation = mean1 - similarity.scale * (*rotation * mean2);
  return similarity;
}

std::optional<Similarity> Align(AlignmentKind kind,
                                const std::vector<PosePair>& poses) {
  if (kind == AlignmentKind::kNone) return Similarity();
  const std::optional<Similarity> similarity =
      kind == AlignmentKind::kFrame ? AlignFrames(poses) : AlignCenters(poses);
  const bool is_same = std::all_of(poses.begin(), poses.end(), &AreEqual);
  return similarity && is_same ? Similarity() : similarity;
}

}  // namespace krot::internal

namespace krot {

using namespace internal;

Model TransformModel(const Model& model, const Similarity& world1_from_world2) {
  Model result = model;
  if (IsIdentity(world1_from_world2)) return result;
  for (Rig& rig : result.rigs) {
    for (RigSensor& sensor : rig.sensors) {
      if (!sensor.sensor_from_rig) continue;
      sensor.sensor_from_rig->translation *= world1_from_world2.scale;
    }
  }
  for (Frame& frame : result.frames) {
    Transform(world1_from_world2, &frame.rig_from_world);
  }
  for (Image& image : result.images) {
    Transform(world1_from_world2, &image.cam_from_world);
  }
  for (Point3D& point : result.points3D) {
    point.xyz = world1_from_world2 * point.xyz;
  }
  return result;
}

}  // namespace krot
