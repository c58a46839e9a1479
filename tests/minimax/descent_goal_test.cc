// Descents from a warm start, and descents that end early.

#include <gtest/gtest.h>

#include "krot/minimax/fast_descent.h"
#include "tests/testing/random_residuals.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

class DescentGoalTest : public testing::TestWithParam<double> {
 protected:
  Norm norm() const { return {GetParam()}; }

  ProblemGenerator generator_{11};
  FastDescent descent_{FastDescentOptions{}, norm()};
};

TEST_P(DescentGoalTest, AWarmStartLeadsToTheSameOptimum) {
  for (int rays = 2; rays <= 40; ++rays) {
    const ResidualProblem problem = generator_.Triangulation(rays, 5);
    Fill(problem, &descent_.residuals());
    ActiveResiduals active;
    Vector3d x = generator_.Start(problem, 0.1);
    const double cold = descent_.Minimize(DescentGoal{}, &active, &x).cost;
    ASSERT_GE(active.size, 1);
    float sum = 0;
    for (int k = 0; k < active.size; ++k) sum += active.multiplier[k];
    EXPECT_NEAR(sum, 1, 1e-6);

    Vector3d y = generator_.Start(problem, 0.1);
    const DescentSummary warm = descent_.Minimize(DescentGoal{}, &active, &y);
    EXPECT_EQ(warm.termination, DescentTermination::kStationary);
    EXPECT_NEAR(warm.cost, cold, 1e-9);
  }
}

// Whatever the active residuals and multipliers that it is told.
TEST_P(DescentGoalTest, AWrongWarmStartLeadsToTheSameOptimumToo) {
  for (int rays = 4; rays <= 40; ++rays) {
    const ResidualProblem problem = generator_.Triangulation(rays, 5);
    Fill(problem, &descent_.residuals());
    Vector3d x = generator_.Start(problem, 0.1);
    const double cold = descent_.Minimize(&x).cost;
    ActiveResiduals wrong{4, {rays - 1, 0, rays / 2, 1}, {.1F, .2F, .3F, .4F}};
    Vector3d y = generator_.Start(problem, 0.1);
    EXPECT_NEAR(descent_.Minimize(DescentGoal{}, &wrong, &y).cost, cold, 1e-9);
  }
}

TEST_P(DescentGoalTest, ACoarseDescentEndsNearTheOptimumAfterFewerSteps) {
  for (const double tolerance : {1e-3, 1e-2}) {
    int coarse_steps = 0;
    int fine_steps = 0;
    for (int rays = 2; rays <= 40; ++rays) {
      const ResidualProblem problem = generator_.Triangulation(rays, 5);
      Fill(problem, &descent_.residuals());
      const Vector3d start = generator_.Start(problem, 0.1);
      Vector3d x = start;
      const DescentSummary fine = descent_.Minimize(&x);
      ActiveResiduals none;
      Vector3d y = start;
      const DescentSummary coarse =
          descent_.Minimize({tolerance, /*level=*/0}, &none, &y);
      EXPECT_LE(coarse.cost, (1 + 2 * tolerance) * fine.cost);
      EXPECT_GE(coarse.cost, fine.cost - 1e-9);
      coarse_steps += coarse.iterations;
      fine_steps += fine.iterations;
    }
    EXPECT_LT(coarse_steps, fine_steps);
  }
}

TEST_P(DescentGoalTest, ADescentEndsWithTheStepThatIsSufficient) {
  int num_early = 0;
  for (int rays = 4; rays <= 40; ++rays) {
    const ResidualProblem problem = generator_.Triangulation(rays, 5);
    Fill(problem, &descent_.residuals());
    const Vector3d start = generator_.Start(problem, 0.1);
    Vector3d x = start;
    const DescentSummary whole = descent_.Minimize(&x);
    DescentGoal goal;
    goal.sufficient = (whole.cost + whole.cost_initial) / 2;
    ActiveResiduals none;
    Vector3d y = start;
    const DescentSummary early = descent_.Minimize(goal, &none, &y);
    EXPECT_LE(early.cost, goal.sufficient);
    EXPECT_EQ(early.cost, descent_.residuals().Evaluate(y, norm()));
    EXPECT_LE(early.iterations, whole.iterations);
    num_early += early.termination == DescentTermination::kLowEnough;

    goal.sufficient = 0.99 * whole.cost;  // is out of reach
    Vector3d z = start;
    none = {};
    EXPECT_EQ(descent_.Minimize(goal, &none, &z).cost, whole.cost);
  }
  EXPECT_GE(num_early, 30);
}

TEST_P(DescentGoalTest, AStartAtTheLevelStaysWhereItIs) {
  const ResidualProblem problem = generator_.Triangulation(10, 5);
  Fill(problem, &descent_.residuals());
  const Vector3d start = generator_.Start(problem, 0.1);
  const double cost = descent_.residuals().Evaluate(start, norm());
  Vector3d x = start;
  ActiveResiduals none;
  const DescentSummary summary = descent_.Minimize({1e-11, cost}, &none, &x);
  EXPECT_EQ(summary.termination, DescentTermination::kLowEnough);
  EXPECT_EQ(summary.cost, cost);
  EXPECT_EQ(summary.iterations, 0);
  EXPECT_EQ(x, start);
  EXPECT_EQ(none.size, 0);

  descent_.Minimize({1e-11, 0.999 * cost}, &none, &x);
  EXPECT_NE(x, start);
}

INSTANTIATE_TEST_SUITE_P(, DescentGoalTest,
                         testing::Values(1, 1.5, 2, 3, Norm::LInf().p));

}  // namespace
}  // namespace krot::internal
