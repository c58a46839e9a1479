// Alternation can stop above the optimum, whatever [Zhang18, Sec. 2.1] says.

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/problem/cost.h"
#include "krot/sweeps/res_int.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// Three frames, none of them turned, see two points exactly: six observations
// of a focal length of 1000 px, and kTrue costs nothing.
const Estimate kTrue = {{{0, 0, 0}, {-2, 3, 0}, {3, 2, 0}},
                        {{2, -1, 6}, {2, 1, 7}}};
const Estimate kStart = {{{-0.3, 0, 0}, {-1.7, 3.1, 0}, {3.3, 2, 0}},
                         {{1.7, -1, 6}, {2.3, 1.3, 7}}};

KnownRotationProblem MakeProblem() {
  KnownRotationProblem problem;
  problem.num_frames = 3;
  problem.num_points = 2;
  for (int f = 0; f < 3; ++f) {
    problem.views.push_back({Eigen::Matrix3d::Identity(),
                             Eigen::Matrix3d::Identity(), Vector3d::Zero(), f});
  }
  for (int k = 0; k < 2; ++k) {
    for (int f = 0; f < 3; ++f) {
      const Vector3d x_cam = kTrue.points[k] + kTrue.translations[f];
      problem.observations.push_back(
          {RowAtRay(x_cam.hnormalized(), 1000 * Eigen::Matrix2d::Identity()), f,
           k});
    }
  }
  IndexObservations(&problem);
  return problem;
}

TEST(Alternation, IsStuckAtTwoPixelsWhereNoneAreAttainable) {
  const KnownRotationProblem problem = MakeProblem();
  const Norm norm = Norm::LInf();
  EXPECT_LT(Cost(problem, kTrue, norm, 1), 1e-12);

  Estimate estimate = kStart;
  BlockSweep blocks(problem, FastDescentOptions{}, norm, Context{1});
  const auto sweep = [&](int times) {
    for (int n = 0; n < times; ++n) {
      blocks.IntersectPoints(&estimate);
      blocks.ResectFrames(&estimate);
    }
    return Cost(problem, estimate, norm, 1);
  };
  EXPECT_NEAR(Cost(problem, kStart, norm, 1), 100, 1e-9);
  const double stuck = sweep(150);
  EXPECT_NEAR(stuck, 2.1754, 1e-3);
  EXPECT_NEAR(sweep(1000), stuck, 1e-9);
}

}  // namespace
}  // namespace krot::internal
