#include "krot/geometry/consensus.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "krot/base/numbers.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// A runaway moves by more than so many times the median move: where much is
// moved a lot, as from a rough start, nobody runs away.
constexpr double kTypicalMoves = 10;
// The common move is found from those that share it, which it decides on.
constexpr int kMaxRounds = 3;

// after -> before.
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
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> shifts;
    for (const CameraMove& camera : cameras) {
      shifts.push_back(camera.before[axis] - scale * camera.after[axis]);
    }
    move.shift[axis] = LowerMedian(std::move(shifts));
  }
  return move;
}

// With the centroids and, if it is free, the RMS distances from them.
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

// The RMS distance, before, of those that count from their centroid.
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
