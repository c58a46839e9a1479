#include <cmath>

#include "krot/pipeline/settling.h"
#include "krot/problem/gauge.h"

namespace krot::internal {

using Eigen::Vector3d;

// Neither fixed nor at a known position.
std::vector<int32_t> Settling::FramesThatMove() const {
  std::vector<char> has_position(problem_.num_frames, 0);
  for (const BuiltPosition& position : built_.positions) {
    if (position.of != KnownPosition::Of::kImage) continue;
    has_position[problem_.views[position.index].frame] = 1;
  }
  std::vector<int32_t> frames;
  for (size_t n = 0; n < built_.frame_of.size(); ++n) {
    const auto f = static_cast<int32_t>(n);
    if (components_.of_frame[f] < 0 || problem_.IsFixedFrame(f)) continue;
    if (has_position[f] == 0) frames.push_back(f);
  }
  return frames;
}

// Sums of squares that are as good as a frame's own.
std::vector<double> Settling::LimitsOf(
    const std::vector<int32_t>& frames) const {
  return SumsOf(frames, as_good_, [&](int64_t i, int64_t, double* limit) {
    *limit += squared_[i];
  });
}

// Whether the frames are where their centres are shifted: one by one, each with
// all else as it is.
std::vector<char> Settling::AreAsGood(const std::vector<int32_t>& frames,
                                      const std::vector<Vector3d>& shifts,
                                      const std::vector<double>& limits,
                                      double level) {
  const std::vector<Vector3d> translations = estimate_.translations;
  for (size_t n = 0; n < frames.size(); ++n) Shift(frames[n], shifts[n]);
  const std::vector<double> sums =
      SumsOf(frames, 0.0, [&](int64_t i, int64_t n, double* sum) {
        if (*sum <= limits[n]) *sum += Squared(i, level);
      });
  estimate_.translations = translations;
  std::vector<char> are_as_good;
  for (size_t n = 0; n < frames.size(); ++n) {
    are_as_good.push_back(std::isfinite(limits[n]) && sums[n] <= limits[n]);
  }
  return are_as_good;
}

Vector3d Settling::FromFrame(int64_t i) const {
  const Observation& o = problem_.observations[i];
  return estimate_.points[o.point] -
         CentreOf(problem_.views[o.view].frame, estimate_);
}

// Of the directions in which frames see points, unit length.
std::vector<Vector3d> Settling::MeanRays(
    const std::vector<int32_t>& frames) const {
  std::vector<Vector3d> rays =
      SumsOf(frames, Vector3d(0, 0, 0), [&](int64_t i, int64_t, Vector3d* sum) {
        *sum += FromFrame(i).normalized();
      });
  for (Vector3d& ray : rays) ray.normalize();
  return rays;
}

// Those that are as good where they are and farther from or nearer to what they
// see by the typical distance.
void Settling::FindLooseFrames() {
  const std::vector<int32_t> frames = FramesThatMove();
  const std::vector<double> limits = LimitsOf(frames);
  const std::vector<double> distances = TypicalDistances();
  const std::vector<Vector3d> rays = MeanRays(frames);
  for (const double sign : {-1.0, 1.0}) {
    std::vector<Vector3d> shifts;
    for (size_t n = 0; n < frames.size(); ++n) {
      const double distance = distances[components_.of_frame[frames[n]]];
      shifts.push_back(sign * distance * rays[n]);
    }
    const std::vector<char> as_good =
        AreAsGood(frames, shifts, limits, kNoLevel);
    for (size_t n = 0; n < frames.size(); ++n) {
      is_loose_frame_[frames[n]] |= as_good[n];
    }
  }
}

// Along the mean of the frame's rays, which is where it is free to go, to what
// is nearest to the input; where the input has its points behind it, towards
// the typical distance in front of them.
void Settling::MoveLooseFrame(int32_t f, double distance) {
  if (!input_.translations[f].allFinite()) return;
  const std::vector<int32_t> frame = {f};
  const Vector3d ray = MeanRays(frame)[0];
  const Vector3d depths =
      SumsOf(frame, Vector3d(0, 0, 0), [&](int64_t i, int64_t, Vector3d* sum) {
        *sum += Vector3d(ray.dot(FromFrame(i)), 1, 0);
      })[0];
  const double depth = depths[0] / depths[1];
  const Vector3d to_input = CentreOf(f, input_) - CentreOf(f, estimate_);
  double along = ray.dot(to_input);
  if (!(along < depth)) along = depth - distance;
  const std::vector<double> limits = LimitsOf(frame);
  const double share = LargestShare([&](double s) {
    return AreAsGood(frame, {s * along * ray}, limits, level_)[0] != 0;
  });
  const Vector3d shift = share * along * ray;
  if (!((shift - to_input).norm() < to_input.norm())) return;
  Shift(f, shift);
  has_moved_frame_ = true;
  for (int64_t j = problem_.frame_begin[f]; j < problem_.frame_begin[f + 1];
       ++j) {
    const int32_t i = problem_.frame_observations[j];
    squared_[i] = Squared(i, kNoLevel);
  }
}

void Settling::SettleFrames() {
  FindLooseFrames();
  is_held_frame_ = FindHeldFrames(problem_, built_.start, estimate_,
                                  is_loose_frame_, context_);
  RestoreGaugeIfHarmless(problem_, built_.start, options_.norm, context_,
                         &estimate_, &is_held_frame_);
  const std::vector<double> distances = TypicalDistances();
  for (int32_t f = 0; f < problem_.num_frames; ++f) {
    if (is_loose_frame_[f] == 0) continue;
    MoveLooseFrame(f, distances[components_.of_frame[f]]);
  }
}

}  // namespace krot::internal
