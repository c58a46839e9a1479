#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/LU>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/convert/reprojection.h"
#include "krot/pipeline/solve_model.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// The largest share in [0, 1] of a way for which `is_good` holds, by bisection.
// Assumes that it holds at 0.
template <typename IsGood>
double LargestShare(const IsGood& is_good) {
  if (is_good(1.0)) return 1;
  double good = 0;
  double bad = 1;
  for (int n = 0; n < 50; ++n) {
    const double middle = 0.5 * (good + bad);
    (is_good(middle) ? good : bad) = middle;
  }
  return good;
}

// The steps of SettleEstimate: the noise is measured, then every frame is moved
// with all else fixed, then every point.
class Settling {
 public:
  Settling(const Model& model, const BuiltProblem& built, Norm norm,
           const Context& context, Estimate* estimate)
      : model_(model),
        built_(built),
        problem_(built.problem),
        norm_(norm),
        context_(context),
        reprojection_(model, built),
        input_(OwnEstimate(model, built)),
        components_(FindComponents(built.problem, context)),
        frames_(DescribeFrames(built.problem, context)),
        estimate_(*estimate),
        is_loose_frame_(problem_.num_frames, 0),
        is_held_frame_(problem_.num_frames, 1),
        is_loose_point_(problem_.num_points, 0) {
    Measure();
  }

  void SettleFrames() {
    FindLooseFrames();
    is_held_frame_ = FindHeldFrames(problem_, built_.start, estimate_,
                                    is_loose_frame_, context_);
    RestoreGaugeIfHarmless(problem_, built_.start, norm_, context_, &estimate_,
                           &is_held_frame_);
    std::vector<double> distances;
    for (int32_t f = 0; f < problem_.num_frames; ++f) {
      if (is_loose_frame_[f] == 0) continue;
      if (distances.empty()) distances = TypicalDistances();
      MoveLooseFrame(f, distances[components_.of_frame[f]]);
    }
  }

  void SettlePoints() {
    const std::vector<double> distances = TypicalDistances();
    ParallelForEach(static_cast<int64_t>(built_.point_of.size()),
                    context_.num_threads, [&](int64_t n) {
                      const auto k = static_cast<int32_t>(n);
                      const int32_t c = components_.of_point[k];
                      if (c >= 0) SettlePoint(k, distances[c]);
                    });
  }

  LooseParts Describe() const {
    LooseParts parts;
    parts.have_moved = AnyRank(context_, has_moved_);
    std::vector<int64_t> num_observations(problem_.views.size(), 0);
    for (const Observation& o : problem_.observations)
      ++num_observations[o.view];
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

 private:
  // For each frame, the sum over its observations on all ranks, from `zero` on.
  template <typename Sum, typename AddTo>
  std::vector<Sum> SumsOf(const std::vector<int32_t>& frames, const Sum& zero,
                          const AddTo& add_to) const {
    std::vector<Sum> sums(frames.size(), zero);
    InTurnOfRanks(
        context_,
        [&](std::vector<Sum>* of_whole) {
          ParallelFor(static_cast<int64_t>(frames.size()), /*chunk_size=*/1,
                      context_.num_threads, [&](int64_t n, int64_t, int) {
                        for (const int32_t i : problem_.OfFrame(frames[n])) {
                          add_to(i, n, &(*of_whole)[n]);
                        }
                      });
        },
        &sums);
    return sums;
  }

  // Estimates the noise's variance per axis. The median length of a Gaussian
  // error in the plane is sqrt(2 ln 2) times its standard deviation per axis,
  // and fitting the unknowns lowers the sum of squares by their share of its
  // degrees of freedom.
  void Measure() {
    level_ = MaxOfRanks(context_, reprojection_.TrueCost(estimate_, norm_,
                                                         context_.num_threads));
    squared_.assign(problem_.observations.size(), -1);
    ParallelForEach(static_cast<int64_t>(squared_.size()), context_.num_threads,
                    [&](int64_t i) {
                      if (reprojection_.IsOfModel(i))
                        squared_[i] = Squared(i, kInfinity);
                    });
    const auto num_errors =
        static_cast<double>(2 * SumOfRanks(context_, built_.NumPixels()));
    const auto num_unknowns = static_cast<double>(
        3 *
        (static_cast<int64_t>(built_.frame_of.size()) +
         SumOfRanks(context_, static_cast<int64_t>(built_.point_of.size()))));
    const double share_left =
        std::max(1.0, num_errors - num_unknowns) / num_errors;
    const double noise =
        MedianOf(squared_, context_) / (2 * std::log(2.0)) / share_left;
    // A sum of squared errors counts as equally good if it rises by at most
    // nine times the variance of the noise: along one parameter that
    // corresponds to three standard deviations. Smaller noise than this is
    // rounding.
    as_good_ = 9 * std::max(noise, 1e-9 * 1e-9);
  }

  // The squared error of observation i; infinite if its error in the norm of
  // the solve is above `level`, pixels.
  double Squared(int64_t i, double level) const {
    const double error = reprojection_.Error(estimate_, Norm::L2(), i);
    if (level < kInfinity &&
        !((norm_.p == 2 ? error : reprojection_.Error(estimate_, norm_, i)) <=
          level)) {
      return kInfinity;
    }
    return error * error;
  }

  // The median distance between camera and point per component, scene units.
  std::vector<double> TypicalDistances() const {
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

  Vector3d CentreOf(int32_t frame, const Estimate& estimate) const {
    return frames_[frame].world_from_rig *
           (frames_[frame].centre_in_rig - estimate.translations[frame]);
  }
  void Shift(int32_t frame, const Vector3d& by) {
    estimate_.translations[frame] -=
        frames_[frame].world_from_rig.transpose() * by;
  }

  // The frames that are neither fixed nor at a known position.
  std::vector<int32_t> FramesThatMove() const {
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

  // For each frame, the largest sum of squared errors that is as good as its
  // own.
  std::vector<double> LimitsOf(const std::vector<int32_t>& frames) const {
    return SumsOf(frames, as_good_, [&](int64_t i, int64_t, double* limit) {
      *limit += squared_[i];
    });
  }

  // For each frame, whether it fits as well if its centre is shifted, with all
  // else as it is: its sum of squares is within its limit and no error is above
  // `level`.
  std::vector<char> AreAsGood(const std::vector<int32_t>& frames,
                              const std::vector<Vector3d>& shifts,
                              const std::vector<double>& limits, double level) {
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

  Vector3d FromFrame(int64_t i) const {
    return estimate_.points[problem_.observations[i].point] -
           CentreOf(problem_.FrameOf(i), estimate_);
  }

  // For each frame, the mean of the directions in which it sees its points,
  // unit length.
  std::vector<Vector3d> MeanRays(const std::vector<int32_t>& frames) const {
    std::vector<Vector3d> rays = SumsOf(frames, Vector3d(0, 0, 0),
                                        [&](int64_t i, int64_t, Vector3d* sum) {
                                          *sum += FromFrame(i).normalized();
                                        });
    for (Vector3d& ray : rays) ray.normalize();
    return rays;
  }

  // Finds the frames that fit as well if they move by the typical distance away
  // from or towards what they see.
  void FindLooseFrames() {
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
      const auto as_good = AreAsGood(frames, shifts, limits, kInfinity);
      for (size_t n = 0; n < frames.size(); ++n) {
        is_loose_frame_[frames[n]] |= as_good[n];
      }
    }
  }

  // Moves a frame along its mean ray, the direction in which it is not
  // determined, to the place nearest to the input. If that is beyond its
  // points, it moves to the typical distance in front of them instead. In both
  // cases it goes only as far as it fits as well.
  void MoveLooseFrame(int32_t f, double distance) {
    if (!input_.translations[f].allFinite()) return;
    const std::vector<int32_t> frame = {f};
    const Vector3d ray = MeanRays(frame)[0];
    const Vector3d depths = SumsOf(
        frame, Vector3d(0, 0, 0), [&](int64_t i, int64_t, Vector3d* sum) {
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
    has_moved_ = true;
    for (const int32_t i : problem_.OfFrame(f)) {
      squared_[i] = Squared(i, kInfinity);
    }
  }

  // Whether point k at `position` has a sum of squared errors up to `limit`,
  // with no error above `level`.
  bool IsAsGood(int32_t k, const Vector3d& position, double limit,
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
  // if it also fits at the typical distance, or is nearer than that: a point
  // that is certainly far away, as clouds are, is determined well enough.
  void SettlePoint(int32_t k, double distance) {
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
      centre += internal::CentreOf(camera);
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
    const double far = 1e6 * std::max(depth, distance);  // as if infinite
    if (!std::isfinite(limit) || !IsAsGood(k, at(far), limit, kInfinity))
      return;
    is_loose_point_[k] =
        depth <= distance || IsAsGood(k, at(distance), limit, kInfinity);
    const Vector3d& input = input_.points[k];
    if (!input.allFinite()) return;
    const double wanted = ray.dot(input - centre);
    const Vector3d way = at(wanted > 0 ? wanted : distance) - from;
    const double share = LargestShare(
        [&](double s) { return IsAsGood(k, from + s * way, limit, level_); });
    const Vector3d to = from + share * way;
    if (!((to - input).norm() < (from - input).norm())) return;
    estimate_.points[k] = to;
    has_moved_ = true;
  }

  const Model& model_;
  const BuiltProblem& built_;
  const KnownRotationProblem& problem_;
  const Norm norm_;
  const Context& context_;
  const Reprojection reprojection_;
  const Estimate input_;
  const Components components_;
  const std::vector<FrameGeometry> frames_;
  Estimate& estimate_;
  double level_ = 0;             // the largest error, pixels
  double as_good_ = 0;           // a rise that noise explains, pixels^2
  std::vector<double> squared_;  // errors of the observations, pixels^2
  std::vector<char> is_loose_frame_;
  std::vector<char> is_held_frame_;
  std::vector<char> is_loose_point_;
  std::atomic<bool> has_moved_ = false;  // a frame or a point
};

}  // namespace

LooseParts SettleEstimate(const Model& model, const BuiltProblem& built,
                          Norm norm, bool update_frames, const Context& context,
                          Estimate* estimate) {
  Settling settling(model, built, norm, context, estimate);
  if (update_frames) settling.SettleFrames();
  settling.SettlePoints();
  return settling.Describe();
}

}  // namespace krot::internal
