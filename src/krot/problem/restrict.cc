#include "krot/problem/restrict.h"

#include <string>

#include "krot/base/check.h"
#include "krot/problem/components.h"

namespace krot {
namespace {

// Numbers the marked elements in their order; the others get -1.
std::vector<int32_t> Renumber(const std::vector<char>& is_kept,
                              std::vector<int32_t>* old_of) {
  std::vector<int32_t> new_of(is_kept.size(), -1);
  for (size_t n = 0; n < is_kept.size(); ++n) {
    if (!is_kept[n]) continue;
    new_of[n] = static_cast<int32_t>(old_of->size());
    old_of->push_back(static_cast<int32_t>(n));
  }
  return new_of;
}

void CheckAscending(const KnownRotationProblem& problem,
                    const std::vector<int64_t>& observations) {
  const int64_t count = static_cast<int64_t>(problem.observations.size());
  int64_t previous = -1;
  for (size_t n = 0; n < observations.size(); ++n) {
    if (observations[n] <= previous || observations[n] >= count) {
      CheckArgument(
          false, "observations[" + std::to_string(n) + "]", observations[n],
          "> " + std::to_string(previous) + " and < " + std::to_string(count));
    }
    previous = observations[n];
  }
}

int32_t FrameOf(const KnownRotationProblem& problem, int64_t observation) {
  return problem.views[problem.observations[observation].view].frame;
}

}  // namespace

RestrictedProblem RestrictProblem(const KnownRotationProblem& problem,
                                  const std::vector<int64_t>& observations) {
  CheckAscending(problem, observations);
  std::vector<char> has_point(problem.num_points, 0);
  std::vector<char> has_view(problem.views.size(), 0);
  std::vector<char> has_frame(problem.num_frames, 0);
  for (const int64_t i : observations) {
    has_point[problem.observations[i].point] = 1;
    has_view[problem.observations[i].view] = 1;
    has_frame[FrameOf(problem, i)] = 1;
  }

  RestrictedProblem part;
  part.observation_of = observations;
  const std::vector<int32_t> new_point = Renumber(has_point, &part.point_of);
  const std::vector<int32_t> new_view = Renumber(has_view, &part.view_of);
  const std::vector<int32_t> new_frame = Renumber(has_frame, &part.frame_of);
  part.problem.num_points = static_cast<int32_t>(part.point_of.size());
  part.problem.num_frames = static_cast<int32_t>(part.frame_of.size());
  for (const int32_t v : part.view_of) {
    part.problem.views.push_back(problem.views[v]);
    part.problem.views.back().frame = new_frame[problem.views[v].frame];
  }
  part.problem.observations.reserve(observations.size());
  for (const int64_t i : observations) {
    part.problem.observations.push_back(problem.observations[i]);
    Observation& observation = part.problem.observations.back();
    observation.view = new_view[observation.view];
    observation.point = new_point[observation.point];
  }
  IndexObservations(&part.problem);
  return part;
}

Estimate RestrictEstimate(const RestrictedProblem& part,
                          const Estimate& whole) {
  Estimate estimate;
  for (const int32_t f : part.frame_of) {
    estimate.translations.push_back(whole.translations.at(f));
  }
  for (const int32_t k : part.point_of) {
    estimate.points.push_back(whole.points.at(k));
  }
  return estimate;
}

void ReplaceEstimate(const RestrictedProblem& part, const Estimate& estimate,
                     Estimate* whole) {
  for (size_t f = 0; f < part.frame_of.size(); ++f) {
    whole->translations.at(part.frame_of[f]) = estimate.translations.at(f);
  }
  for (size_t k = 0; k < part.point_of.size(); ++k) {
    whole->points.at(part.point_of[k]) = estimate.points.at(k);
  }
}

std::vector<std::vector<int64_t>> SplitIntoComponents(
    const KnownRotationProblem& problem,
    const std::vector<int64_t>& observations) {
  const RestrictedProblem part = RestrictProblem(problem, observations);
  const Components components = FindComponents(part.problem);
  std::vector<std::vector<int64_t>> split(components.count);
  for (size_t i = 0; i < observations.size(); ++i) {
    const int32_t point = part.problem.observations[i].point;
    split[components.of_point[point]].push_back(observations[i]);
  }
  return split;
}

std::vector<int64_t> PruneUnconstrained(
    const KnownRotationProblem& problem,
    const std::vector<int64_t>& observations) {
  const RestrictedProblem part = RestrictProblem(problem, observations);
  const KnownRotationProblem& p = part.problem;
  const size_t count = observations.size();
  std::vector<int64_t> left_of_point(p.num_points);
  std::vector<int64_t> left_of_frame(p.num_frames);
  std::vector<int64_t> doomed;  // still to be dropped; may repeat
  std::vector<char> is_dropped(count, 0);

  // Dooms the last observation of a point, or of a frame.
  const auto check_point = [&](int32_t k) {
    if (left_of_point[k] != 1) return;
    for (int64_t i = p.point_begin[k]; i < p.point_begin[k + 1]; ++i) {
      if (!is_dropped[i]) doomed.push_back(i);
    }
  };
  const auto check_frame = [&](int32_t f) {
    if (left_of_frame[f] != 1) return;
    for (int64_t n = p.frame_begin[f]; n < p.frame_begin[f + 1]; ++n) {
      const int64_t i = p.frame_observations[n];
      if (!is_dropped[i]) doomed.push_back(i);
    }
  };

  for (int32_t k = 0; k < p.num_points; ++k) {
    left_of_point[k] = p.point_begin[k + 1] - p.point_begin[k];
    check_point(k);
  }
  for (int32_t f = 0; f < p.num_frames; ++f) {
    left_of_frame[f] = p.frame_begin[f + 1] - p.frame_begin[f];
    check_frame(f);
  }
  while (!doomed.empty()) {
    const int64_t i = doomed.back();
    doomed.pop_back();
    if (is_dropped[i]) continue;
    is_dropped[i] = 1;
    const int32_t point = p.observations[i].point;
    const int32_t frame = FrameOf(p, i);
    --left_of_point[point];
    --left_of_frame[frame];
    check_point(point);
    check_frame(frame);
  }

  std::vector<int64_t> kept;
  for (size_t i = 0; i < count; ++i) {
    if (!is_dropped[i]) kept.push_back(observations[i]);
  }
  return kept;
}

}  // namespace krot
