#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/problem/known_rotation_problem.h"

namespace krot {

// x -> R x + o as the matrix [R o].
using AffineMap = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

// World coordinates to those of a view's camera, whose frame stands at
// `translation`: R = R_sr R_rw, o = R_sr t_f + t_sr.
inline AffineMap CamFromWorld(const View& view,
                              const Eigen::Vector3d& translation) {
  AffineMap map;
  map.leftCols<3>() = view.cam_from_world_rotation;
  map.col(3) =
      view.cam_from_rig_rotation * translation + view.cam_from_rig_translation;
  return map;
}

// That of every view.
inline std::vector<AffineMap> CamerasFromWorld(
    const KnownRotationProblem& problem,
    const std::vector<Eigen::Vector3d>& translations) {
  std::vector<AffineMap> cameras;
  cameras.reserve(problem.views.size());
  for (const View& view : problem.views) {
    cameras.push_back(CamFromWorld(view, translations[view.frame]));
  }
  return cameras;
}

}  // namespace krot
