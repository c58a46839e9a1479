#include "krot/conic/block_structure.h"

#include <algorithm>
#include <functional>

#include "krot/problem/components.h"

namespace krot {

BlockStructure AnchoredStructure(const KnownRotationProblem& problem,
                                 const Context& context) {
  BlockStructure structure;
  structure.point_begin = problem.point_begin;
  structure.frame_of.reserve(problem.observations.size());
  for (const Observation& observation : problem.observations) {
    structure.frame_of.push_back(problem.views[observation.view].frame);
  }
  std::vector<int64_t> count;
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    count.push_back(problem.frame_begin[f + 1] - problem.frame_begin[f]);
  }
  context.Reduce(std::plus<int64_t>(), &count);
  const Components components = FindComponents(problem, context);
  std::vector<char> is_held(components.count, 0);
  if (!problem.fixed_points.empty()) {
    structure.point_is_fixed.assign(problem.num_points, 0);
  }
  for (int32_t k = 0; k < problem.num_points; ++k) {
    if (!problem.IsFixedPoint(k)) continue;
    structure.point_is_fixed[k] = 1;
    if (components.of_point[k] >= 0) is_held[components.of_point[k]] = 1;
  }
  structure.frame_is_fixed.assign(problem.num_frames, 0);
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    if (components.of_frame[f] >= 0 && !problem.IsFixedFrame(f)) continue;
    structure.frame_is_fixed[f] = 1;
    if (components.of_frame[f] >= 0) is_held[components.of_frame[f]] = 1;
  }
  std::vector<int32_t> anchor(components.count, -1);
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    if (components.of_frame[f] < 0 || is_held[components.of_frame[f]]) continue;
    int32_t& best = anchor[components.of_frame[f]];
    if (best < 0 || count[f] > count[best]) best = f;
  }
  for (const int32_t f : anchor) {
    if (f >= 0) structure.frame_is_fixed[f] = 1;
  }
  return structure;
}

std::vector<int32_t> OrderByFrame(const BlockStructure& structure) {
  std::vector<int32_t> order;
  order.reserve(structure.num_observations());
  for (int64_t k = 0; k < structure.num_points(); ++k) {
    const int64_t begin = structure.point_begin[k];
    const int64_t end = structure.point_begin[k + 1];
    for (int64_t i = begin; i < end; ++i) {
      order.push_back(static_cast<int32_t>(i - begin));
    }
    std::sort(order.begin() + begin, order.end(), [&](int32_t a, int32_t b) {
      const int32_t frame_a = structure.frame_of[begin + a];
      const int32_t frame_b = structure.frame_of[begin + b];
      return frame_a != frame_b ? frame_a < frame_b : a < b;
    });
  }
  return order;
}

}  // namespace krot
