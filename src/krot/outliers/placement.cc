#include "krot/outliers/robust_start.h"

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/convert/build_problem.h"
#include "krot/finish/least_squares.h"
#include "krot/outliers/parts.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// Finds a place near most rays, of which there must be one. error(n, place) is
// the error of the n-th ray there; none counts for more than the cap. Starts at
// `depth` along the first ray.
template <typename Error>
Vector3d FindRobustPlace(const std::vector<Ray>& rays, double cap, double depth,
                         const Error& error) {
  const int64_t count = SignedSize(rays);
  const auto score_of = [&](const Vector3d& place) {
    double sum = 0;
    for (int64_t n = 0; n < count; ++n) sum += std::min(cap, error(n, place));
    return sum;
  };
  Vector3d best = rays.front().centre + depth * rays.front().direction;
  double lowest = score_of(best);
  const auto try_midpoint = [&](const std::vector<Ray>& of) {
    const std::optional<Vector3d> midpoint = RetriangulateMidpoint(of);
    const double score = midpoint ? score_of(*midpoint) : kInfinity;
    if (!(score < lowest)) return;
    lowest = score;
    best = *midpoint;
  };
  ForSomePairs(count, 60, [&](int64_t a, int64_t b) {
    try_midpoint({rays[a], rays[b]});
  });
  std::vector<Ray> agreeing;
  for (int64_t n = 0; n < count; ++n) {
    if (error(n, best) < cap) agreeing.push_back(rays[n]);
  }
  try_midpoint(agreeing);
  return best;
}

// The median depth of all points but the given ones; 1 if there are none.
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

std::vector<int32_t> AllPoints(const KnownRotationProblem& problem) {
  return NumbersUpTo<int32_t>(problem.num_points);
}

Vector3d DirectionOf(const KnownRotationProblem& problem, int64_t i) {
  const Observation& o = problem.observations[i];
  const Vector3d ray = o.E.row(1).cross(o.E.row(2)).transpose();
  return (problem.views[o.view].cam_from_world_rotation.transpose() * ray)
      .normalized();
}

void PlacePointsRobustly(const KnownRotationProblem& problem,
                         const std::vector<int32_t>& points, Norm norm,
                         double cap, const Context& context,
                         Estimate* estimate) {
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem, estimate->translations);
  const double depth = MedianDepthOfOthers(problem, points, *estimate);
  const auto place = [&](int32_t k) {
    const int64_t first = problem.point_begin[k];
    std::vector<Ray> rays;
    for (int64_t i = first; i < problem.point_begin[k + 1]; ++i) {
      rays.push_back({CentreOf(cameras[problem.observations[i].view]),
                      DirectionOf(problem, i)});
    }
    const auto error = [&](int64_t n, const Vector3d& xyz) {
      const Observation& o = problem.observations[first + n];
      return ResidualOf(ViewPoint(cameras[o.view], o, xyz), norm);
    };
    estimate->points[k] = FindRobustPlace(rays, cap, depth, error);
  };
  ParallelForEach(
      static_cast<int64_t>(points.size()), context.num_threads,
      [&](int64_t n) { place(points[n]); }, /*chunk_size=*/64);
}

void PlaceFramesRobustly(const KnownRotationProblem& problem,
                         const std::vector<int32_t>& frames,
                         const std::vector<char>& is_placed, Norm norm,
                         double cap, const Context& context,
                         Estimate* estimate) {
  const std::vector<Eigen::Matrix3d> rig_from_world =
      RigFromWorldRotations(problem);
  const auto place = [&](int32_t f) {
    std::vector<Ray> rays;
    std::vector<int64_t> seen;
    for (const int32_t i : problem.OfFrame(f)) {
      const Observation& o = problem.observations[i];
      if (!is_placed[o.point]) continue;
      const View& view = problem.views[o.view];
      // From the camera's centre to the frame's origin.
      const Vector3d to_origin = view.cam_from_world_rotation.transpose() *
                                 view.cam_from_rig_translation;
      rays.push_back(
          {estimate->points[o.point] + to_origin, -DirectionOf(problem, i)});
      seen.push_back(i);
    }
    if (rays.empty()) return;
    const auto error = [&](int64_t n, const Vector3d& origin) {
      const Observation& o = problem.observations[seen[n]];
      const AffineMap camera =
          CamFromWorld(problem.views[o.view], -rig_from_world[f] * origin);
      return ResidualOf(ViewPoint(camera, o, estimate->points[o.point]), norm);
    };
    estimate->translations[f] =
        -rig_from_world[f] * FindRobustPlace(rays, cap, 1, error);
  };
  ParallelForEach(
      static_cast<int64_t>(frames.size()), context.num_threads,
      [&](int64_t n) { place(frames[n]); }, /*chunk_size=*/1);
}

std::vector<std::vector<int64_t>> SplitIntoParts(
    const KnownRotationProblem& problem, const std::vector<int32_t>& part_of) {
  std::vector<std::vector<int64_t>> split(NumParts(part_of));
  for (int32_t k = 0; k < problem.num_points; ++k) {
    for (const int64_t i : problem.OfPoint(k)) {
      const int32_t own = part_of[problem.FrameOf(i)];
      int num_own = 0;
      for (const int64_t j : problem.OfPoint(k)) {
        num_own += part_of[problem.FrameOf(j)] == own;
      }
      if (num_own >= 2) split[own].push_back(i);
    }
  }
  return split;
}

void PlaceParts(const KnownRotationProblem& problem,
                const std::vector<int32_t>& part_of, Norm norm, double level,
                const Context& context, const PlacePart& place,
                Estimate* estimate) {
  const std::vector<std::vector<int64_t>> split =
      SplitIntoParts(problem, part_of);
  std::vector<int32_t> point_part(problem.num_points, -1);
  for (size_t n = 0; n < split.size(); ++n) {
    if (split[n].empty()) continue;
    const ProblemSubset part(problem, split[n]);
    Estimate own = part.Restrict(*estimate);
    if (place) {
      place(part.problem(),
            context.Within("part " + std::to_string(n + 1) + " of " +
                           std::to_string(split.size())),
            &own);
    }
    if (!HasBaseline(part.problem())) NormalizeScale(part.problem(), &own);
    part.Replace(own, estimate);
    for (const int64_t i : split[n]) {
      point_part[problem.observations[i].point] = static_cast<int32_t>(n);
    }
  }
  JoinParts(problem, part_of, point_part, kCapOfPoints * level, context,
            estimate);
  std::vector<int32_t> across;
  for (int32_t k = 0; k < problem.num_points; ++k) {
    for (const int64_t i : problem.OfPoint(k)) {
      if (part_of[problem.FrameOf(i)] == point_part[k]) continue;
      across.push_back(k);
      break;
    }
  }
  PlacePointsRobustly(problem, across, norm, kCapOfPoints * level, context,
                      estimate);
  if (!HasBaseline(problem)) NormalizeScale(problem, estimate);
}

namespace {

// Which observations an estimate explains.
struct Agreement {
  Agreement(const KnownRotationProblem& problem, const Estimate& estimate,
            Norm norm, double cap);

  // Per observation, whether it and another one of its track agree.
  std::vector<char> agrees;
  int64_t num_agreeing = 0;
  // Frames that disagree with most of what they see of the others' points.
  std::vector<int32_t> loose_frames;
  std::vector<int32_t> loose_points;  // no two observations agree; ascending
  std::vector<char> is_placed;        // points that two other frames agree on
};

Agreement::Agreement(const KnownRotationProblem& problem,
                     const Estimate& estimate, Norm norm, double cap)
    : agrees(problem.observations.size()), is_placed(problem.num_points, 0) {
  const auto count = static_cast<int64_t>(agrees.size());
  std::vector<int64_t> num_of_frame(problem.num_frames, 0);
  for (int32_t k = 0; k < problem.num_points; ++k) {
    std::vector<int64_t> own;
    for (const int64_t i : problem.OfPoint(k)) {
      const Observation& o = problem.observations[i];
      if (ResidualOf(ViewPoint(problem, o, estimate), norm) <= cap) {
        own.push_back(i);
      }
    }
    if (own.size() < 2) {
      loose_points.push_back(k);
      continue;
    }
    num_agreeing += static_cast<int64_t>(own.size());
    for (const int64_t i : own) {
      agrees[i] = 1;
      ++num_of_frame[problem.FrameOf(i)];
    }
  }
  // Loose: less than half of the share that agrees everywhere.
  std::vector<char> is_loose(problem.num_frames);
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    const int64_t num_seen =
        problem.frame_begin[f + 1] - problem.frame_begin[f];
    is_loose[f] = 2 * num_of_frame[f] * count < num_seen * num_agreeing;
    if (is_loose[f]) loose_frames.push_back(f);
  }
  for (int32_t k = 0; k < problem.num_points; ++k) {
    int num = 0;
    for (const int64_t i : problem.OfPoint(k)) {
      num += agrees[i] && !is_loose[problem.FrameOf(i)];
    }
    is_placed[k] = num >= 2;
  }
}

}  // namespace

int64_t NumAgreeing(const KnownRotationProblem& problem,
                    const Estimate& estimate, Norm norm, double cap) {
  return Agreement(problem, estimate, norm, cap).num_agreeing;
}

int32_t MinimizeAndJoin(const KnownRotationProblem& problem, Norm norm,
                        double level, const Context& context,
                        Estimate* estimate) {
  MinimizeRobustly(problem, context, estimate);
  // What has not helped is tried again only after something else has.
  bool joins_parts = true, places_frames = true, places_points = true;
  double cap = 0;
  std::optional<Agreement> now;
  std::vector<int32_t> part_of;
  for (int n = 0;; ++n) {
    if (!now) {
      cap =
          kCapOfPoints * std::max(level, MedianError(problem, *estimate, norm));
      now.emplace(problem, *estimate, norm, cap);
      part_of = FindParts(problem, now->agrees, {});
    }
    const int32_t num_parts = NumParts(part_of);
    if (n == 8 || context.IsCancelled()) return num_parts;
    Estimate moved = *estimate;
    const auto gain = [&] {
      return NumAgreeing(problem, moved, norm, cap) - now->num_agreeing;
    };
    // By a thousandth: less is not worth a descent.
    const auto is_much = [&](int64_t num_more) {
      return 1000 * num_more > now->num_agreeing;
    };
    bool* tried = &places_points;
    std::vector<int32_t> loose_points = now->loose_points;
    if (num_parts > 1 && joins_parts) {
      tried = &joins_parts;
      PlaceParts(problem, part_of, norm, level, context, {}, &moved);
    } else if (!now->loose_frames.empty() && places_frames) {
      tried = &places_frames;
      PlaceFramesRobustly(problem, now->loose_frames, now->is_placed, norm,
                          kCapOfPoints * level, context, &moved);
      loose_points = Agreement(problem, moved, norm, cap).loose_points;
    } else if (loose_points.empty() || !places_points) {
      return num_parts;
    }
    PlacePointsRobustly(problem, loose_points, norm, kCapOfPoints * level,
                        context, &moved);
    int64_t num_more = gain();
    if (tried == &joins_parts || is_much(num_more)) {
      MinimizeRobustly(problem, context, &moved);
      num_more = gain();
    }
    if (is_much(num_more)) {
      joins_parts = places_frames = places_points = true;
    } else {
      *tried = false;
    }
    if (num_more > 0) {
      *estimate = std::move(moved);
      now.reset();
    }
  }
}

}  // namespace krot::internal
