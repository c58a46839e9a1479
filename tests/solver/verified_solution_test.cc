#include "krot/solver/verified_solution.h"

#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/LU>
#include <Eigen/QR>

namespace krot {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd RandomMatrix(int rows, int columns, std::mt19937* generator) {
  std::normal_distribution<double> normal;
  return MatrixXd::NullaryExpr(rows, columns,
                               [&](auto, auto) { return normal(*generator); });
}

TEST(BoundSolution, HoldsForEverySystemWithinTheUncertainty) {
  std::mt19937 generator(1);
  for (int trial = 0; trial < 50; ++trial) {
    const MatrixXd M = RandomMatrix(8, 12, &generator);
    const VectorXd g = RandomMatrix(8, 1, &generator);
    const MatrixXd M_error = MatrixXd::Constant(8, 12, 1e-3);
    const std::optional<VectorXd> bound =
        BoundSolution({M, M_error, g.cwiseAbs()});
    if (!bound) continue;  // too badly conditioned for this uncertainty
    const MatrixXd other =
        M + 1e-3 * RandomMatrix(8, 12, &generator).cwiseMax(-1).cwiseMin(1);
    // Of all solutions the bound speaks of the one in the span of X.
    const MatrixXd X = M.completeOrthogonalDecomposition().pseudoInverse();
    const VectorXd a = -X * (other * X).partialPivLu().solve(g);
    EXPECT_LE((other * a + g).norm(), 1e-9);
    EXPECT_TRUE((a.cwiseAbs().array() <= bound->array()).all());
    // And is no more than a few times too large.
    EXPECT_LE(bound->maxCoeff(), 100 * X.cwiseAbs().maxCoeff() * g.norm());
  }
}

TEST(BoundSolution, DoesNotDependOnTheUnitsOfARow) {
  std::mt19937 generator(2);
  const MatrixXd M = RandomMatrix(5, 9, &generator);
  const VectorXd g = 1e-9 * VectorXd::Ones(5);
  UncertainSystem scaled{M, 1e-12 * M.cwiseAbs(), g};
  const std::optional<VectorXd> bound = BoundSolution(scaled);
  ASSERT_TRUE(bound);
  scaled.M.row(2) *= 0x1p-200;
  scaled.M_error.row(2) *= 0x1p-200;
  scaled.g_bound[2] *= 0x1p-200;
  EXPECT_EQ(*BoundSolution(scaled), *bound);
}

TEST(BoundSolution, GivesNoneUnlessFullRankIsProved) {
  std::mt19937 generator(3);
  MatrixXd M = RandomMatrix(6, 9, &generator);
  const MatrixXd none = MatrixXd::Zero(6, 9);
  const VectorXd g = VectorXd::Zero(6);
  EXPECT_TRUE(BoundSolution({M, none, g}));
  EXPECT_FALSE(BoundSolution({M, M.cwiseAbs(), g}));
  M.row(3) = M.row(1) + 2 * M.row(5);
  EXPECT_FALSE(BoundSolution({M, none, g}));
  M.row(3) += 1e-17 * RandomMatrix(1, 9, &generator);
  EXPECT_FALSE(BoundSolution({M, none, g}));
  M.row(3).setZero();
  EXPECT_FALSE(BoundSolution({M, none, g}));
  EXPECT_FALSE(BoundSolution(
      {M.leftCols(5), none.leftCols(5), g}));  // fewer unknowns than rows
}

TEST(BoundSolution, GivesNoneForNumbersThatAreNotFinite) {
  std::mt19937 generator(4);
  const MatrixXd M = RandomMatrix(3, 4, &generator);
  for (const double bad : {std::numeric_limits<double>::infinity(),
                           std::numeric_limits<double>::quiet_NaN()}) {
    UncertainSystem system{M, MatrixXd::Zero(3, 4), VectorXd::Zero(3)};
    system.g_bound[1] = bad;
    EXPECT_FALSE(BoundSolution(system));
    system.g_bound[1] = 0;
    system.M_error(1, 1) = bad;
    EXPECT_FALSE(BoundSolution(system));
    system.M_error(1, 1) = 0;
    system.M(1, 1) = bad;
    EXPECT_FALSE(BoundSolution(system));
  }
}

}  // namespace
}  // namespace krot
