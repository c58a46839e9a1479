#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "krot/finish/least_squares.h"
#include "krot/outliers/parts.h"
#include "krot/outliers/robust_start.h"
#include "krot/problem/cost.h"
#include "krot/problem/gauge.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

// For every part its observations of the points that it observes at least
// twice.
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

}  // namespace

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
