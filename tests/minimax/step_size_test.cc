#include "krot/minimax/fast_descent.h"

#include <cmath>

#include <gtest/gtest.h>

#include "krot/math/simplex_qp.h"
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

// Descents from a warm start, and descents that end early.

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

std::vector<Vector3d> RandomNormals(int count, ProblemGenerator* generator) {
  std::vector<Vector3d> normals;
  for (int i = 0; i < count; ++i) {
    normals.push_back(generator->Normal3().normalized());
  }
  return normals;
}

std::optional<Vector3d> Direction(const std::vector<Vector3d>& normals,
                                  double tolerance) {
  std::vector<LinearPiece> scratch;
  return FindDescentDirection(normals, tolerance, &scratch);
}

double SlowestDecrease(const std::vector<Vector3d>& normals,
                       const Vector3d& direction) {
  double slowest = 1;
  for (const Vector3d& g : normals)
    slowest = std::min(slowest, g.dot(direction));
  return slowest;
}

// [Zhang18, Theorem 1] and the equivalence behind Theorem 3.
TEST(DescentDirection, DescendsOnEveryNormalOrTheOriginIsInTheirHull) {
  ProblemGenerator generator(1);
  int stationary = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const std::vector<Vector3d> normals =
        RandomNormals(1 + trial % 6, &generator);
    const auto direction = Direction(normals, 1e-8);
    if (direction) {
      EXPECT_NEAR(direction->norm(), 1, 1e-12);
      EXPECT_GT(SlowestDecrease(normals, *direction), 0);
    } else {
      ++stationary;
      std::vector<LinearPiece> scratch;
      EXPECT_LE(MinNormPoint(normals.data(), static_cast<int>(normals.size()),
                             &scratch)
                    .norm(),
                1e-7);
    }
  }
  EXPECT_GT(stationary, 50);
}

// [Zhang18, Theorem 2], against random and neighbouring directions.
TEST(DescentDirection, IsTheSteepestForUnitNormals) {
  ProblemGenerator generator(2);
  for (int trial = 0; trial < 300; ++trial) {
    const std::vector<Vector3d> normals =
        RandomNormals(1 + trial % 6, &generator);
    const auto direction = Direction(normals, 1e-8);
    if (!direction) continue;
    const double best = SlowestDecrease(normals, *direction);
    for (int other = 0; other < 100; ++other) {
      const double reach = std::pow(10, -5 * generator.Uniform());
      const Vector3d rival =
          (*direction + reach * generator.Normal3()).normalized();
      EXPECT_LE(SlowestDecrease(normals, rival), best + 1e-12);
    }
  }
}

TEST(DescentDirection, OfOneNormalIsTheNormal) {
  const Vector3d g = Vector3d(1, 2, -2) / 3;
  EXPECT_TRUE(Direction({g}, 1e-8)->isApprox(g));
}

TEST(DescentDirection, NeedsANormal) {
  EXPECT_FALSE(Direction({}, 1e-8).has_value());
}

TEST(DescentDirection, OppositeNormalsAreStationary) {
  EXPECT_FALSE(
      Direction({Vector3d::UnitX(), -Vector3d::UnitX()}, 1e-8).has_value());
}

// [Zhang18, Theorem 3]: none at the optimum, one elsewhere.
TEST(DescentDirection, VanishesAtTheOptimumAlone) {
  ProblemGenerator generator(4);
  for (int trial = 0; trial < 100; ++trial) {
    const ResidualProblem problem = generator.Triangulation(6, 5);
    FastDescent descent(FastDescentOptions{}, Norm::L2());
    Fill(problem, &descent.residuals());
    const Vector3d start = generator.Start(problem, 0.3);
    std::vector<Vector3d> normals;
    descent.residuals().Evaluate(start, Norm::L2());
    FindDescentNormals(descent.residuals(), start, Norm::L2(), 1e-9, &normals);
    EXPECT_TRUE(Direction(normals, 1e-3).has_value());

    Vector3d x = start;
    descent.Minimize(&x);
    descent.residuals().Evaluate(x, Norm::L2());
    FindDescentNormals(descent.residuals(), x, Norm::L2(), 1e-9, &normals);
    EXPECT_GE(normals.size(), 2u);
    EXPECT_FALSE(Direction(normals, 1e-3).has_value());
  }
}

TEST(DescentNormals, AreUnitVectorsOfTheActiveResiduals) {
  ProblemGenerator generator(6);
  const ResidualProblem problem = generator.Triangulation(8, 5);
  ResidualSet set;
  Fill(problem, &set);
  const Vector3d x = generator.Start(problem, 0.3);
  const double cost = set.Evaluate(x, Norm::L2());
  for (const double tolerance : {0.0, 0.3, 0.9}) {
    int active = 0;
    for (const Residual& residual : problem.residuals) {
      active += ResidualValue(residual, x, Norm::L2()) >=
                (1 - tolerance) * cost * (1 - 1e-12);
    }
    std::vector<Vector3d> normals;
    FindDescentNormals(set, x, Norm::L2(), tolerance, &normals);
    EXPECT_EQ(static_cast<int>(normals.size()), active);
    for (const Vector3d& g : normals) EXPECT_NEAR(g.norm(), 1, 1e-12);
  }
}

}  // namespace
}  // namespace krot::internal
