
#include <cmath>

#include <gtest/gtest.h>

#include "krot/math/simplex_qp.h"
#include "krot/minimax/fast_descent.h"
#include "tests/testing/random_residuals.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

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
