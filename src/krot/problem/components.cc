#include "krot/problem/components.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "krot/base/disjoint_sets.h"

namespace krot::internal {
namespace {

// Unites frames that points of other ranks connect.
void UniteRanks(Ranks* ranks, std::vector<char>* is_seen,
                DisjointSets* frames) {
  const auto num_frames = static_cast<int64_t>(is_seen->size());
  ranks->Reduce([](char a, char b) { return std::max(a, b); }, is_seen);
  std::vector<int64_t> roots;
  for (int64_t f = 0; f < num_frames; ++f) roots.push_back(frames->Find(f));
  const std::vector<int64_t> all = ranks->Gather(roots);
  for (size_t n = 0; n < all.size(); ++n) {
    frames->Unite(static_cast<int64_t>(n) % num_frames, all[n]);
  }
}

// Components of the graph that has these edges.
Components FindComponentsOf(const KnownRotationProblem& problem,
                            const std::vector<int64_t>& observations,
                            const Context& context) {
  const auto point_of = [&](int64_t n) {
    return problem.observations[observations[n]].point;
  };
  const auto frame_of = [&](int64_t n) {
    return problem.views[problem.observations[observations[n]].view].frame;
  };
  const int64_t count = static_cast<int64_t>(observations.size());

  // Two frames are connected if they see one point.
  DisjointSets frames(problem.num_frames);
  std::vector<char> is_seen(problem.num_frames, 0);
  for (int64_t n = 0; n < count; ++n) {
    is_seen[frame_of(n)] = 1;
    if (n > 0 && point_of(n) == point_of(n - 1)) {
      frames.Unite(frame_of(n), frame_of(n - 1));
    }
  }
  if (context.ranks != nullptr) UniteRanks(context.ranks, &is_seen, &frames);

  Components components;
  components.of_frame.assign(problem.num_frames, -1);
  components.of_point.assign(problem.num_points, -1);
  for (int32_t frame = 0; frame < problem.num_frames; ++frame) {
    if (!is_seen[frame]) continue;
    const int64_t root = frames.Find(frame);
    components.of_frame[frame] =
        root == frame ? components.count++ : components.of_frame[root];
  }
  for (int64_t n = 0; n < count; ++n) {
    components.of_point[point_of(n)] = components.of_frame[frame_of(n)];
  }
  return components;
}

std::vector<int64_t> All(const KnownRotationProblem& problem) {
  std::vector<int64_t> all(problem.observations.size());
  std::iota(all.begin(), all.end(), 0);
  return all;
}

}  // namespace

Components FindComponents(const KnownRotationProblem& problem,
                          const Context& context) {
  return FindComponentsOf(problem, All(problem), context);
}

std::vector<std::vector<int64_t>> SplitIntoComponents(
    const KnownRotationProblem& problem) {
  return SplitIntoComponents(problem, All(problem));
}

std::vector<std::vector<int64_t>> SplitIntoComponents(
    const KnownRotationProblem& problem, std::vector<int64_t> observations) {
  const Components components = FindComponentsOf(problem, observations, {});
  std::vector<std::vector<int64_t>> split(components.count);
  if (components.count == 1) {
    split[0] = std::move(observations);
    return split;
  }
  for (const int64_t i : observations) {
    split[components.of_point[problem.observations[i].point]].push_back(i);
  }
  return split;
}

}  // namespace krot::internal
