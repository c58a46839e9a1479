#include "krot/adjust/projected_errors.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "krot/base/parallel_for.h"
#include "krot/camera/camera_model.h"

namespace krot {
namespace {

constexpr int64_t kChunkSize = 4096;

std::vector<Eigen::Matrix3d> Rotations(const std::vector<PoseBlock>& poses) {
  std::vector<Eigen::Matrix3d> rotations;
  rotations.reserve(poses.size());
  for (const PoseBlock& pose : poses) rotations.push_back(RotationOf(pose));
  return rotations;
}

}  // namespace

std::optional<std::vector<ProjectedError>> ProjectErrors(
    const AdjustmentBlocks& blocks, double max_error, int num_threads) {
  const std::vector<Eigen::Matrix3d> frames = Rotations(blocks.frames);
  const std::vector<Eigen::Matrix3d> sensors = Rotations(blocks.sensors);
  const auto project = [&](const AdjustmentObservation& observation) {
    const int32_t f = observation.frame, s = observation.sensor;
    Eigen::Vector3d x = frames[f] * blocks.points[observation.point] +
                        TranslationOf(blocks.frames[f]);
    if (s >= 0) x = sensors[s] * x + TranslationOf(blocks.sensors[s]);
    const int32_t c = observation.camera;
    return ProjectedError{
        ProjectRay(blocks.camera_models[c], blocks.cameras[c].data(),
                   x.hnormalized()) -
            observation.pixel,
        x.z()};
  };
  const auto count = static_cast<int64_t>(blocks.observations.size());
  std::vector<ProjectedError> errors(count);
  std::atomic<bool> is_feasible{true};
  ParallelFor(count, kChunkSize, num_threads,
              [&](int64_t begin, int64_t end, int) {
                for (int64_t i = begin; i < end && is_feasible; ++i) {
                  errors[i] = project(blocks.observations[i]);
                  if (!(errors[i].w > 0 && errors[i].r.norm() < max_error)) {
                    is_feasible = false;
                  }
                }
              });
  if (!is_feasible) return std::nullopt;
  return errors;
}

double HalfSquaredNorm(const std::vector<ProjectedError>& errors) {
  double sum = 0;
  for (const ProjectedError& error : errors) sum += error.r.squaredNorm();
  return sum / 2;
}

double LargestError(const std::vector<ProjectedError>& errors) {
  double largest2 = 0;
  for (const ProjectedError& error : errors) {
    largest2 = std::max(largest2, error.r.squaredNorm());
  }
  return std::sqrt(largest2);
}

}  // namespace krot
