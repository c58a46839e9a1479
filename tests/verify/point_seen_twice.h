#pragma once

#include "krot/problem/known_rotation_problem.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

inline constexpr double kFocal = 1000;  // pixels

// One image sees one point twice, `separation` apart on the plane z = 1: for
// every norm the optimum is half of that times the focal length.
struct Twice {
  KnownRotationProblem problem;
  Certificate certificate;  // the optimum's, by hand
};

inline Twice MakeTwice(double separation) {
  Twice twice;
  KnownRotationProblem& problem = twice.problem;
  problem.num_frames = problem.num_points = 1;
  problem.views.push_back({Eigen::Matrix3d::Identity(),
                           Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(),
                           0});
  const Eigen::Matrix2d J = kFocal * Eigen::Matrix2d::Identity();
  problem.observations = {{RowAtRay({-separation / 2, 0}, J), 0, 0},
                          {RowAtRay({separation / 2, 0}, J), 0, 0}};
  IndexObservations(&problem);
  // f (y_1 + y_2) = 0,  f (u_2 - u_1)'y_1 + delta (lambda_1 + lambda_2) = 0.
  twice.certificate = {
      separation / 2 * kFocal, 1e-9, {{0, 1, {-1, 0}}, {1, 1, {1, 0}}}};
  return twice;
}

}  // namespace krot::internal
