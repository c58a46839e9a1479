#pragma once

#include "tests/problem/random_problem.h"

namespace krot::internal {

// Small scenes to solve jointly; with a baseline every frame has two cameras.
inline RandomScene MakeSmallScene(unsigned seed, double baseline = 0) {
  RandomSceneOptions options;
  options.num_frames = 3 + static_cast<int>(seed % 4);
  options.num_points = 5 + static_cast<int>(7 * seed % 26);
  options.views_per_frame = baseline > 0 ? 2 : 1;
  options.baseline = baseline;
  options.seed = seed;
  return MakeRandomScene(options);
}

// Both scenes in one problem, unconnected; `first` keeps its indices.
inline RandomScene Glue(const RandomScene& first, const RandomScene& second) {
  RandomScene glued = first;
  KnownRotationProblem& problem = glued.problem;
  for (View view : second.problem.views) {
    view.frame += first.problem.num_frames;
    problem.views.push_back(view);
  }
  for (Observation o : second.problem.observations) {
    o.view += static_cast<int32_t>(first.problem.views.size());
    o.point += first.problem.num_points;
    problem.observations.push_back(o);
  }
  problem.num_frames += second.problem.num_frames;
  problem.num_points += second.problem.num_points;
  IndexObservations(&problem);
  for (const Eigen::Vector3d& t : second.estimate.translations) {
    glued.estimate.translations.push_back(t);
  }
  for (const Eigen::Vector3d& s : second.estimate.points) {
    glued.estimate.points.push_back(s);
  }
  return glued;
}

// Appends a frame with one view, and a point, that no observation mentions.
inline void AddUnseen(RandomScene* scene) {
  KnownRotationProblem& problem = scene->problem;
  problem.views.push_back({Eigen::Matrix3d::Identity(),
                           Eigen::Matrix3d::Identity(),
                           {0, 0, 0},
                           problem.num_frames++});
  ++problem.num_points;
  IndexObservations(&problem);
  scene->estimate.translations.emplace_back(7, 8, 9);
  scene->estimate.points.emplace_back(-1, -2, -3);
}

}  // namespace krot::internal
