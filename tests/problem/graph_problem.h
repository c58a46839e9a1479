#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Who sees what, and nothing else: one view per frame; pairs are (frame,
// point), ordered by point.
inline KnownRotationProblem MakeGraph(
    int32_t num_frames, int32_t num_points,
    const std::vector<std::pair<int, int>>& edges) {
  KnownRotationProblem problem;
  problem.num_frames = num_frames;
  problem.num_points = num_points;
  problem.views.resize(num_frames);
  for (int32_t f = 0; f < num_frames; ++f) problem.views[f].frame = f;
  for (const auto& [frame, point] : edges) {
    problem.observations.push_back(
        {RowAtRay({0, 0}, Eigen::Matrix2d::Identity()), frame, point});
  }
  IndexObservations(&problem);
  return problem;
}

}  // namespace krot::internal
