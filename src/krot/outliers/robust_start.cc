#include "krot/outliers/robust_start.h"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/conic/interior_point.h"
#include "krot/convert/build_steps.h"
#include "krot/finish/least_squares.h"
#include "krot/outliers/parts.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

constexpr int64_t kPointsPerTask = 64;
// So many of a long track's pairs are tried, about.
constexpr int64_t kTriedPairs = 60;

class RobustPoint {
 public:
  RobustPoint(const KnownRotationProblem& problem,
              const std::vector<AffineMap>& cameras, Norm norm, double cap,
              double depth)
      : problem_(problem),
        cameras_(cameras),
        norm_(norm),
        cap_(cap),
        depth_(depth) {}

  Vector3d Place(int32_t point) {
    begin_ = problem_.point_begin[point];
    end_ = problem_.point_begin[point + 1];
    rays_.clear();
    for (int64_t i = begin_; i < end_; ++i) rays_.push_back(RayOf(i));
    best_ = rays_.front().centre + depth_ * rays_.front().direction;
    lowest_ = Score(best_);
    const int64_t count = end_ - begin_;
    const int64_t num_pairs = count * (count - 1) / 2;
    const int64_t stride = std::max<int64_t>(1, num_pairs / kTriedPairs);
    int64_t pair = 0;
    for (int64_t gap = count - 1; gap > 0; --gap) {
      for (int64_t a = 0; a + gap < count; ++a, ++pair) {
        if (pair % stride == 0) Try({rays_[a], rays_[a + gap]});
      }
    }
    std::vector<Ray> agreeing;
    for (int64_t i = begin_; i < end_; ++i) {
      if (Error(i, best_) < cap_) agreeing.push_back(rays_[i - begin_]);
    }
    Try(agreeing);
    return best_;
  }

 private:
  // Where v = 0 and w > 0.
  Ray RayOf(int64_t i) const {
    const Observation& o = problem_.observations[i];
    const AffineMap& camera = cameras_[o.view];
    Vector3d ray = o.E.row(1).cross(o.E.row(2)).transpose();
    if (o.E.row(0).dot(ray) < 0) ray = -ray;
    const auto world_from_cam = camera.leftCols<3>().transpose();
    return {-world_from_cam * camera.col(3),
            (world_from_cam * ray).normalized()};
  }
  double Error(int64_t i, const Vector3d& xyz) const {
    const Observation& o = problem_.observations[i];
    return std::min(cap_,
                    ResidualOf(ViewPoint(cameras_[o.view], o, xyz), norm_));
  }
  double Score(const Vector3d& xyz) const {
    double sum = 0;
    for (int64_t i = begin_; i < end_; ++i) sum += Error(i, xyz);
    return sum;
  }
  void Try(const std::vector<Ray>& rays) {
    const std::optional<Vector3d> midpoint = RetriangulateMidpoint(rays);
    if (!midpoint) return;
    const double score = Score(*midpoint);
    if (!(score < lowest_)) return;
    lowest_ = score;
    best_ = *midpoint;
  }

  const KnownRotationProblem& problem_;
  const std::vector<AffineMap>& cameras_;
  const Norm norm_;
  const double cap_;
  const double depth_;
  int64_t begin_ = 0, end_ = 0;  // observations of the point
  std::vector<Ray> rays_;        // theirs
  Vector3d best_ = Vector3d::Zero();
  double lowest_ = 0;
};

// Of the observations of all points but the given ones; 1 if there are none.
double MedianDepthOfOthers(const KnownRotationProblem& problem,
                           const std::vector<int32_t>& points,
                           const Estimate& estimate) {
  std::vector<double> depths;
  for (const Observation& o : problem.observations) {
    if (std::binary_search(points.begin(), points.end(), o.point)) continue;
    depths.push_back(ViewPoint(problem, o, estimate).depth);
  }
  return depths.empty() ? 1 : Median(std::move(depths));
}

}  // namespace

void PlacePointsRobustly(const KnownRotationProblem& problem,
                         const std::vector<int32_t>& points, Norm norm,
                         double cap, const Context& context,
                         Estimate* estimate) {
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem, estimate->translations);
  const double depth = MedianDepthOfOthers(problem, points, *estimate);
  ParallelFor(static_cast<int64_t>(points.size()), kPointsPerTask,
              context.num_threads, [&](int64_t begin, int64_t end, int) {
                RobustPoint place(problem, cameras, norm, cap, depth);
                for (int64_t n = begin; n < end; ++n) {
                  estimate->points[points[n]] = place.Place(points[n]);
                }
              });
}

namespace {

// So much redundancy that tracks check each frame by, doubled until they hang
// together. A track of n observations has 2 n - 3, 2 - 3 / n for each of them.
constexpr double kRedundancyPerFrame = 120;
// Parts whose programmes are solved on their own.
constexpr double kStrongShare = 0.2;
// Programmes after the first, with weights.
constexpr int kStartReweightings = 1;
// A start needs no more; of the level.
constexpr double kStartMu = 1e-3;
// In levels.
constexpr double kDearExcess = 0.1;

// The longest tracks first, each that sees a frame which has too few so far.
// Ascending.
std::vector<int64_t> CoveringTracks(const KnownRotationProblem& problem,
                                    double redundancy_per_frame) {
  const auto length = [&](int32_t k) {
    return problem.point_begin[k + 1] - problem.point_begin[k];
  };
  std::vector<int32_t> longest_first(problem.num_points);
  std::iota(longest_first.begin(), longest_first.end(), 0);
  std::stable_sort(longest_first.begin(), longest_first.end(),
                   [&](int32_t a, int32_t b) { return length(a) > length(b); });
  std::vector<double> redundancy(problem.num_frames, 0);
  std::vector<int64_t> covering;
  for (const int32_t k : longest_first) {
    bool is_needed = false;
    for (int64_t i = problem.point_begin[k]; i < problem.point_begin[k + 1];
         ++i) {
      is_needed =
          is_needed || redundancy[FrameOf(problem, i)] < redundancy_per_frame;
    }
    if (!is_needed) continue;
    for (int64_t i = problem.point_begin[k]; i < problem.point_begin[k + 1];
         ++i) {
      redundancy[FrameOf(problem, i)] += 2 - 3 / static_cast<double>(length(k));
      covering.push_back(i);
    }
  }
  std::sort(covering.begin(), covering.end());
  return covering;
}

// The same with as much per frame as it takes for all to hang together.
std::vector<int64_t> ConnectedTracks(const KnownRotationProblem& problem) {
  for (double per_frame = kRedundancyPerFrame;; per_frame *= 2) {
    std::vector<int64_t> tracks = CoveringTracks(problem, per_frame);
    if (tracks.size() == problem.observations.size() ||
        SplitIntoComponents(problem, tracks).size() == 1) {
      return tracks;
    }
  }
}

// Of what hangs together well.
Estimate StartOfPart(const KnownRotationProblem& problem, Norm norm,
                     double level, const Context& context) {
  Estimate estimate;
  estimate.translations.resize(problem.num_frames, Eigen::Vector3d::Zero());
  estimate.points.resize(problem.num_points, Eigen::Vector3d::Zero());
  const std::vector<int64_t> tracks = ConnectedTracks(problem);
  const ProblemSubset part(problem, tracks);
  Estimate own = part.Restrict(estimate);
  SlackOptions options;
  options.norm = norm;
  options.smallest_mu = kStartMu;
  for (int n = 0; n <= kStartReweightings && !context.IsCancelled(); ++n) {
    context.Stage("positions from rotations and tracks, programme", n + 1,
                  kStartReweightings + 1);
    const SlackSolution solution =
        MinimizeSlack(part.problem(), level, options, context, &own);
    options.weights = WeightsAgainst(solution.slack, level, kDearExcess);
  }
  part.Replace(own, &estimate);
  std::vector<char> is_placed(problem.num_points, 0);
  for (const int64_t i : tracks) is_placed[problem.observations[i].point] = 1;
  std::vector<int32_t> others;
  for (int32_t k = 0; k < problem.num_points; ++k) {
    if (!is_placed[k]) others.push_back(k);
  }
  PlacePointsRobustly(problem, others, norm, kCapOfPoints * level, context,
                      &estimate);
  if (!HasBaseline(problem)) NormalizeScale(problem, &estimate);
  return estimate;
}

// The observations of every part that two or more see the points of.
std::vector<std::vector<int64_t>> SplitIntoParts(
    const KnownRotationProblem& problem, const std::vector<int32_t>& part_of) {
  std::vector<std::vector<int64_t>> split(
      *std::max_element(part_of.begin(), part_of.end()) + 1);
  for (int32_t k = 0; k < problem.num_points; ++k) {
    for (int64_t i = problem.point_begin[k]; i < problem.point_begin[k + 1];
         ++i) {
      const int32_t own = part_of[FrameOf(problem, i)];
      int num_own = 0;
      for (int64_t j = problem.point_begin[k]; j < problem.point_begin[k + 1];
           ++j) {
        num_own += part_of[FrameOf(problem, j)] == own;
      }
      if (num_own >= 2) split[own].push_back(i);
    }
  }
  return split;
}

// Of parts that are placed apart, each with its own scale, and joined.
Estimate StartOfParts(const KnownRotationProblem& problem,
                      const std::vector<int32_t>& part_of, Norm norm,
                      double level, const Context& context) {
  const std::vector<std::vector<int64_t>> split =
      SplitIntoParts(problem, part_of);
  Estimate estimate;
  estimate.translations.resize(problem.num_frames, Eigen::Vector3d::Zero());
  estimate.points.resize(problem.num_points, Eigen::Vector3d::Zero());
  std::vector<int32_t> point_part(problem.num_points, -1);
  for (size_t n = 0; n < split.size(); ++n) {
    if (split[n].empty()) continue;
    const ProblemSubset part(problem, split[n]);
    const Context within =
        context.Within("part " + std::to_string(n + 1) + " of " +
                       std::to_string(split.size()));
    Estimate own = StartOfPart(part.problem(), norm, level, within);
    MinimizeRobustly(part.problem(), within, &own);
    if (!HasBaseline(part.problem())) NormalizeScale(part.problem(), &own);
    part.Replace(own, &estimate);
    for (const int64_t i : split[n]) {
      point_part[problem.observations[i].point] = static_cast<int32_t>(n);
    }
  }
  JoinParts(problem, part_of, point_part, kCapOfPoints * level, context,
            &estimate);
  std::vector<int32_t> across;
  for (int32_t k = 0; k < problem.num_points; ++k) {
    for (int64_t i = problem.point_begin[k]; i < problem.point_begin[k + 1];
         ++i) {
      if (part_of[FrameOf(problem, i)] == point_part[k]) continue;
      across.push_back(k);
      break;
    }
  }
  PlacePointsRobustly(problem, across, norm, kCapOfPoints * level, context,
                      &estimate);
  if (!HasBaseline(problem)) NormalizeScale(problem, &estimate);
  return estimate;
}

Estimate StartOfComponent(const KnownRotationProblem& problem, Norm norm,
                          double level, const Context& context) {
  PartOptions options;
  options.min_tracks = 1;
  options.compares_scales = false;
  options.min_share = kStrongShare;
  const std::vector<int32_t> part_of = FindParts(problem, options);
  if (*std::max_element(part_of.begin(), part_of.end()) == 0) {
    return StartOfPart(problem, norm, level, context);
  }
  return StartOfParts(problem, part_of, norm, level, context);
}

}  // namespace

Estimate FindRobustStart(const KnownRotationProblem& problem, Norm norm,
                         double level, const Context& context) {
  Estimate estimate;
  estimate.translations.resize(problem.num_frames, Eigen::Vector3d::Zero());
  estimate.points.resize(problem.num_points, Eigen::Vector3d::Zero());
  for (std::vector<int64_t>& component : SplitIntoComponents(problem)) {
    const ProblemSubset part(problem, std::move(component));
    part.Replace(StartOfComponent(part.problem(), norm, level, context),
                 &estimate);
  }
  return estimate;
}

double MedianError(const KnownRotationProblem& problem,
                   const Estimate& estimate, Norm norm) {
  std::vector<double> errors;
  for (const Observation& o : problem.observations) {
    errors.push_back(ResidualOf(ViewPoint(problem, o, estimate), norm));
  }
  return errors.empty() ? 0 : Median(std::move(errors));
}

}  // namespace krot::internal
