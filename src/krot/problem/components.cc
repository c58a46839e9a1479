#include "krot/problem/components.h"

#include <algorithm>
#include <numeric>

namespace krot {
namespace {

// Union-find with path halving. The root of a set is its smallest member.
class DisjointSets {
 public:
  explicit DisjointSets(int32_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  int32_t Find(int32_t member) {
    while (parent_[member] != member) {
      parent_[member] = parent_[parent_[member]];
      member = parent_[member];
    }
    return member;
  }

  void Unite(int32_t a, int32_t b) {
    const auto [low, high] = std::minmax({Find(a), Find(b)});
    parent_[high] = low;
  }

 private:
  std::vector<int32_t> parent_;
};

}  // namespace

Components FindComponents(const KnownRotationProblem& problem) {
  const auto frame_of = [&](int64_t observation) {
    return problem.views[problem.observations[observation].view].frame;
  };

  // Two frames are connected if they see one point.
  DisjointSets frames(problem.num_frames);
  for (int32_t point = 0; point < problem.num_points; ++point) {
    const int64_t begin = problem.point_begin[point];
    for (int64_t i = begin + 1; i < problem.point_begin[point + 1]; ++i) {
      frames.Unite(frame_of(begin), frame_of(i));
    }
  }

  Components components;
  components.of_frame.assign(problem.num_frames, -1);
  components.of_point.assign(problem.num_points, -1);
  for (int32_t frame = 0; frame < problem.num_frames; ++frame) {
    if (problem.frame_begin[frame] == problem.frame_begin[frame + 1]) continue;
    const int32_t root = frames.Find(frame);
    components.of_frame[frame] =
        root == frame ? components.count++ : components.of_frame[root];
  }
  for (int32_t point = 0; point < problem.num_points; ++point) {
    const int64_t begin = problem.point_begin[point];
    if (begin == problem.point_begin[point + 1]) continue;
    components.of_point[point] = components.of_frame[frame_of(begin)];
  }
  return components;
}

}  // namespace krot
