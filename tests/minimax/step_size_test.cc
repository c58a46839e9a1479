#include "krot/minimax/fast_descent.h"

#include <cmath>

#include <gtest/gtest.h>

#include "tests/testing/random_residuals.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

Vector3d RandomDirection(ProblemGenerator* generator) {
  return generator->Normal3().normalized();
}

TEST(StepSize, MinimisesTheLargestResidualAlongTheLine) {
  for (const Norm norm : {Norm::L1(), Norm::L2(), Norm{3}, Norm::LInf()}) {
    ProblemGenerator generator(1);
    for (int trial = 0; trial < 200; ++trial) {
      const ResidualProblem problem = generator.Triangulation(5, 5);
      ResidualSet set;
      Fill(problem, &set);
      const Vector3d x = generator.Start(problem, 0.3);
      const Vector3d direction = RandomDirection(&generator);
      std::vector<LineResidual> scratch;
      const double alpha =
          FindStepSize(set, x, direction, norm, FastDescentOptions{}, &scratch);
      const double reached = problem.Cost(x + alpha * direction, norm);
      // A slope of at most 1e3 px per unit over the tolerance of 1e-6.
      for (const double other : {0.0, 0.5 * alpha, 0.9 * alpha, alpha - 1e-4,
                                 alpha + 1e-4, 1.1 * alpha, 2 * alpha}) {
        if (other < 0) continue;
        EXPECT_LE(reached, problem.Cost(x + other * direction, norm) + 1e-2);
      }
    }
  }
}

// [lb, ub] of Sec. 3.2: where a depth would vanish bounds the step.
TEST(StepSize, StaysWhereAllDepthsArePositive) {
  ProblemGenerator generator(2);
  for (int trial = 0; trial < 500; ++trial) {
    const ResidualProblem problem = generator.Triangulation(5, 200);
    ResidualSet set;
    Fill(problem, &set);
    const Vector3d x = generator.Start(problem, 1);
    const Vector3d direction = RandomDirection(&generator);
    FastDescentOptions options;
    options.max_step = 1e3;
    std::vector<LineResidual> scratch;
    const double alpha =
        FindStepSize(set, x, direction, Norm::L2(), options, &scratch);
    EXPECT_GE(alpha, 0);
    for (const Residual& residual : problem.residuals) {
      EXPECT_GT(residual.Depth(x + alpha * direction), 0);
    }
  }
}

// The cost falls for ever: two cameras side by side, walking away from them.
TEST(StepSize, IsBoundedWhereTheLineIsNot) {
  ResidualSet set;
  for (const double side : {-1.0, 1.0}) {
    Residual ray;
    ray.A << 1000, 0, 0, 0, 1000, 0;
    ray.b << 1000 * side, 0;
    ray.c << 0, 0, 1;
    set.Add(ray);
  }
  FastDescentOptions options;
  options.max_step = 10;
  std::vector<LineResidual> scratch;
  const double alpha = FindStepSize(set, Vector3d(0, 0, 5), Vector3d::UnitZ(),
                                    Norm::L2(), options, &scratch);
  EXPECT_NEAR(alpha, options.max_step, options.step_tolerance);
}

// One camera looks along z at a point that must move by 0.01 sideways.
TEST(StepSize, FindsTheZeroOfOneResidual) {
  ResidualSet set;
  Residual ray;
  ray.A << 1000, 0, 0, 0, 1000, 0;
  ray.b << -10, 0;
  ray.c << 0, 0, 1;
  set.Add(ray);
  std::vector<LineResidual> scratch;
  const double alpha = FindStepSize(set, Vector3d(0, 0, 5), Vector3d::UnitX(),
                                    Norm::L2(), FastDescentOptions{}, &scratch);
  EXPECT_NEAR(alpha, 0.01, 1e-6);
}

}  // namespace
}  // namespace krot::internal
