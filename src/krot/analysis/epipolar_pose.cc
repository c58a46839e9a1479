#include "krot/analysis/epipolar_pose.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

namespace krot::internal {
namespace {

double SignedMatchError(const WitnessMatch& match,
                        const Eigen::Matrix3d& rotation,
                        const Eigen::Vector3d& center) {
  const Eigen::Matrix3d world_from_cam = rotation.transpose();
  return EpipolarMatch(world_from_cam * match.ray, match.other_ray)
      .SignedErrorPx(match.other_center - center);
}

// Rotation and centre after a step: a rotation vector in camera axes, or a
// shift of the centre.
void ApplyStep(PoseChange change, const Eigen::Vector3d& step,
               Eigen::Matrix3d* rotation, Eigen::Vector3d* center) {
  if (change == PoseChange::kMove) {
    *center += step;
  } else if (step.norm() > 0) {
    *rotation = Eigen::AngleAxisd(step.norm(), step.normalized()) * *rotation;
  }
}

// Of a match's signed error by the three parameters of the change: forward
// differences of steps that are small beside what a pixel stands for.
Eigen::Vector3d ErrorGradient(const WitnessMatch& match, PoseChange change,
                              double step, const Eigen::Matrix3d& rotation,
                              const Eigen::Vector3d& center, double error) {
  Eigen::Vector3d gradient;
  for (int i = 0; i < 3; ++i) {
    Eigen::Matrix3d next_rotation = rotation;
    Eigen::Vector3d next_center = center;
    ApplyStep(change, step * Eigen::Vector3d::Unit(i), &next_rotation,
              &next_center);
    gradient[i] =
        (SignedMatchError(match, next_rotation, next_center) - error) / step;
  }
  return gradient;
}

double SumOfErrors(const std::vector<WitnessMatch>& matches,
                   const Eigen::Matrix3d& rotation,
                   const Eigen::Vector3d& center) {
  double sum = 0;
  for (const WitnessMatch& match : matches) {
    sum += std::abs(SignedMatchError(match, rotation, center));
  }
  return sum;
}

}  // namespace

RigidTransform FitEpipolarPose(const std::vector<WitnessMatch>& matches,
                               const RigidTransform& cam_from_world,
                               PoseChange change, double noise_px) {
  constexpr int kMaxIterations = 50;
  constexpr double kDifferenceStep = 1e-7;  // radians, or of the baselines
  constexpr double kLeastGain = 1e-4;       // of the sum, for another iteration
  Eigen::Matrix3d rotation = cam_from_world.rotation;
  Eigen::Vector3d center = Center(cam_from_world);
  double shortest = std::numeric_limits<double>::infinity();
  for (const WitnessMatch& match : matches) {
    shortest = std::min(shortest, (match.other_center - center).norm());
  }
  if (!(shortest > 0) || matches.empty()) return cam_from_world;
  const double difference_step =
      kDifferenceStep * (change == PoseChange::kMove ? shortest : 1);
  double sum = SumOfErrors(matches, rotation, center);
  for (int i = 0; i < kMaxIterations; ++i) {
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right_side = Eigen::Vector3d::Zero();
    for (const WitnessMatch& match : matches) {
      const double error = SignedMatchError(match, rotation, center);
      const Eigen::Vector3d gradient = ErrorGradient(
          match, change, difference_step, rotation, center, error);
      const double weight = 1 / std::max(std::abs(error), noise_px);
      normal += weight * gradient * gradient.transpose();
      right_side -= weight * error * gradient;
    }
    Eigen::Vector3d step = normal.ldlt().solve(right_side);
    if (!step.allFinite()) break;
    // Halved until the sum falls.
    double next_sum = sum;
    Eigen::Matrix3d next_rotation;
    Eigen::Vector3d next_center;
    for (int halvings = 0; halvings < 20 && next_sum >= sum; ++halvings) {
      next_rotation = rotation;
      next_center = center;
      ApplyStep(change, step, &next_rotation, &next_center);
      next_sum = SumOfErrors(matches, next_rotation, next_center);
      step /= 2;
    }
    if (!(next_sum < sum)) break;
    rotation = next_rotation;
    center = next_center;
    const bool is_last = next_sum > (1 - kLeastGain) * sum;
    sum = next_sum;
    if (is_last) break;
  }
  return {rotation, -rotation * center};
}

int64_t NumAgreeing(const std::vector<WitnessMatch>& matches,
                    const RigidTransform& cam_from_world, double tolerance_px) {
  const Eigen::Vector3d center = Center(cam_from_world);
  return std::count_if(
      matches.begin(), matches.end(), [&](const WitnessMatch& match) {
        return std::abs(SignedMatchError(match, cam_from_world.rotation,
                                         center)) <= tolerance_px;
      });
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
