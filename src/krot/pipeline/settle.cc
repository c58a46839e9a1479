#include <algorithm>
#include <cmath>
#include <functional>

#include <Eigen/LU>

#include "krot/base/numbers.h"
#include "krot/model/rigs.h"
#include "krot/model/validate.h"
#include "krot/pipeline/settling.h"
#include "krot/pipeline/solve_model.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"

namespace krot::internal {
namespace {

// A sum of squared errors counts as equally good if it rises by at most this
// times the variance of the noise. Along one parameter that corresponds to
// three standard deviations.
constexpr double kAsGood = 9;
// The noise is assumed to be at least this, pixels; smaller is rounding.
constexpr double kRoundingError = 1e-9;
// This many times the distance of the point, or the typical one, stands for
// infinity.
constexpr double kFarAway = 1e6;

}  // namespace

using Eigen::Vector3d;

// The squared error of observation i; infinite if its error in the norm of the
// solve is above `level`, pixels.
double Settling::Squared(int64_t i, double level) const {
  const double error = reprojection_.Error(estimate_, Norm::L2(), i);
  if (level < kNoLevel &&
      !((options_.norm.p == 2
             ? error
             : reprojection_.Error(estimate_, options_.norm, i)) <= level)) {
    return kNoLevel;
  }
  return error * error;
}

// Estimates the noise's variance per axis. The median length of a Gaussian
// error in the plane is sqrt(2 ln 2) times its standard deviation per axis, and
// fitting the unknowns lowers the sum of squares by their share of its degrees
// of freedom.
void Settling::Measure() {
  level_ = MaxOfRanks(context_, reprojection_.TrueCost(estimate_, options_.norm,
                                                       context_.num_threads));
  squared_.assign(problem_.observations.size(), -1);
  ParallelForEach(static_cast<int64_t>(squared_.size()), context_.num_threads,
                  [&](int64_t i) {
                    if (reprojection_.IsOfModel(i))
                      squared_[i] = Squared(i, kNoLevel);
                  });
  const auto num_errors =
      static_cast<double>(2 * SumOfRanks(context_, built_.NumPixels()));
  const auto num_unknowns = static_cast<double>(
      3 * (static_cast<int64_t>(built_.frame_of.size()) +
           SumOfRanks(context_, static_cast<int64_t>(built_.point_of.size()))));
  const double share_left =
      std::max(1.0, num_errors - num_unknowns) / num_errors;
  const double noise =
      MedianOf(squared_, context_) / (2 * std::log(2.0)) / share_left;
  as_good_ = kAsGood * std::max(noise, kRoundingError * kRoundingError);
}

// The median distance between camera and point per component, scene units.
std::vector<double> Settling::TypicalDistances() const {
  std::vector<double> distances;
  std::vector<int32_t> component_of;
  for (size_t n = 0; n < problem_.observations.size(); ++n) {
    const auto i = static_cast<int64_t>(n);
    const int32_t point = problem_.observations[n].point;
    distances.push_back(reprojection_.IsOfModel(i)
                            ? reprojection_.InCamera(estimate_, i).norm()
                            : -1);
    component_of.push_back(components_.of_point[point]);
  }
  return GroupMedians(distances, component_of, components_.count, context_);
}

// Whether point k at `position` has a sum of squared errors up to `limit`, with
// no error above `level`.
bool Settling::IsAsGood(int32_t k, const Vector3d& position, double limit,
                        double level) {
  const Vector3d was = estimate_.points[k];
  estimate_.points[k] = position;
  double sum = 0;
  for (int64_t i = problem_.point_begin[k];
       i < problem_.point_begin[k + 1] && sum <= limit; ++i) {
    sum += Squared(i, level);
  }
  estimate_.points[k] = was;
  return sum <= limit;
}

// If a point fits as well infinitely far away along its mean ray, it goes to
// the place on that ray that is nearest to the input. It is called loose only
// if it also fits at the typical distance, or is nearer than that: a point that
// is certainly far away, as clouds are, is determined well enough.
void Settling::SettlePoint(int32_t k, double distance) {
  Vector3d centre = Vector3d::Zero();  // of its cameras
  Vector3d ray = Vector3d::Zero();     // the mean, unit length
  double limit = as_good_;
  const int64_t begin = problem_.point_begin[k];
  const int64_t end = problem_.point_begin[k + 1];
  for (int64_t i = begin; i < end; ++i) {
    if (!reprojection_.IsOfModel(i)) return;
    const Observation& o = problem_.observations[i];
    const View& view = problem_.views[o.view];
    const AffineMap camera =
        CamFromWorld(view, estimate_.translations[view.frame]);
    centre -= camera.leftCols<3>().transpose() * camera.col(3);
    const Vector3d ray_in_camera = o.E.inverse().col(0);
    ray += camera.leftCols<3>().transpose() * ray_in_camera.normalized();
    limit += squared_[i];
  }
  if (begin == end || problem_.IsFixedPoint(k)) return;
  centre /= static_cast<double>(end - begin);
  ray.normalize();
  const auto at = [&](double t) -> Vector3d { return centre + t * ray; };
  const Vector3d from = estimate_.points[k];
  const double depth = (from - centre).norm();
  const double far = kFarAway * std::max(depth, distance);
  if (!std::isfinite(limit) || !IsAsGood(k, at(far), limit, kNoLevel)) return;
  is_loose_point_[k] =
      depth <= distance || IsAsGood(k, at(distance), limit, kNoLevel);
  const Vector3d& input = input_.points[k];
  if (!input.allFinite()) return;
  const double wanted = ray.dot(input - centre);
  const Vector3d way = at(wanted > 0 ? wanted : distance) - from;
  const double share = LargestShare(
      [&](double s) { return IsAsGood(k, from + s * way, limit, level_); });
  const Vector3d to = from + share * way;
  if (!((to - input).norm() < (from - input).norm())) return;
  estimate_.points[k] = to;
  has_moved_point_[k] = 1;
}

void Settling::SettlePoints() {
  const std::vector<double> distances = TypicalDistances();
  ParallelForEach(static_cast<int64_t>(built_.point_of.size()),
                  context_.num_threads, [&](int64_t n) {
                    const auto k = static_cast<int32_t>(n);
                    const int32_t c = components_.of_point[k];
                    if (c >= 0) SettlePoint(k, distances[c]);
                  });
}

LooseParts Settling::Describe() const {
  LooseParts parts;
  parts.have_moved =
      AnyRank(context_, has_moved_frame_ ||
                            std::count(has_moved_point_.begin(),
                                       has_moved_point_.end(), char{1}) > 0);
  std::vector<int64_t> num_observations(problem_.views.size(), 0);
  for (const Observation& o : problem_.observations) ++num_observations[o.view];
  ReduceRanks(context_, std::plus<int64_t>(), &num_observations);
  for (size_t v = 0; v < built_.image_of.size(); ++v) {
    const int32_t f = problem_.views[v].frame;
    const bool is_loose = is_loose_frame_[f] != 0;
    const bool is_runaway = is_held_frame_[f] == 0 &&
                            components_.of_frame[f] >= 0 &&
                            input_.translations[f].allFinite();
    if (!is_loose && !is_runaway) continue;
    const Image& image = model_.images[built_.image_of[v]];
    parts.images.push_back(
        {image.id, image.name, num_observations[v], !is_loose,
         (CentreOf(f, estimate_) - CentreOf(f, input_)).norm()});
  }
  for (size_t k = 0; k < built_.point_of.size(); ++k) {
    if (is_loose_point_[k] == 0) continue;
    parts.points.push_back({model_.points3D[built_.point_of[k]].id,
                            (estimate_.points[k] - input_.points[k]).norm()});
  }
  if (context_.ranks != nullptr) {
    parts.points = context_.ranks->Gather(parts.points);
  }
  return parts;
}

LooseParts SettleEstimate(const Model& model, const BuiltProblem& built,
                          const SettleOptions& options, const Context& context,
                          Estimate* estimate) {
  Settling settling(model, built, options, context, estimate);
  if (options.update_frames) settling.SettleFrames();
  settling.SettlePoints();
  return settling.Describe();
}

void MeasureMoves(const Model& before, const Model& after, LooseParts* loose) {
  const std::vector<ImageGeometry> from = ImageGeometries(before);
  const std::vector<ImageGeometry> to = ImageGeometries(after);
  const IdIndex<ImageId> images(before.images);
  for (LooseImage& image : loose->images) {
    const int32_t n = *images.Find(image.image_id);
    image.moved =
        (Center(to[n].cam_from_world) - Center(from[n].cam_from_world)).norm();
  }
  const IdIndex<Point3DId> points(before.points3D);
  for (LoosePoint& point : loose->points) {
    const int32_t n = *points.Find(point.point3D_id);
    point.moved = (after.points3D[n].xyz - before.points3D[n].xyz).norm();
  }
}

// The frames that are neither fixed nor at a known position.
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

// For each frame, the largest sum of squared errors that is as good as its own.
std::vector<double> Settling::LimitsOf(
    const std::vector<int32_t>& frames) const {
  return SumsOf(frames, as_good_, [&](int64_t i, int64_t, double* limit) {
    *limit += squared_[i];
  });
}

// For each frame, whether it fits as well if its centre is shifted, with all
// else as it is: its sum of squares is within its limit and no error is above
// `level`.
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

// For each frame, the mean of the directions in which it sees its points, unit
// length.
std::vector<Vector3d> Settling::MeanRays(
    const std::vector<int32_t>& frames) const {
  std::vector<Vector3d> rays =
      SumsOf(frames, Vector3d(0, 0, 0), [&](int64_t i, int64_t, Vector3d* sum) {
        *sum += FromFrame(i).normalized();
      });
  for (Vector3d& ray : rays) ray.normalize();
  return rays;
}

// Finds the frames that fit as well if they move by the typical distance away
// from or towards what they see.
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

// Moves a frame along its mean ray, the direction in which it is not
// determined, to the place nearest to the input. If that is beyond its points,
// it moves to the typical distance in front of them instead. In both cases it
// goes only as far as it fits as well.
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
  for (const int32_t i : problem_.OfFrame(f)) {
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
