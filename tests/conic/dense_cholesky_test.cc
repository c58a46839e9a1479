#include "krot/conic/dense_cholesky.h"

#include <random>

#include <gtest/gtest.h>
#include <Eigen/LU>

namespace krot {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd RandomPositiveDefinite(int size, std::mt19937* generator) {
  std::normal_distribution<double> normal;
  const MatrixXd A = MatrixXd::NullaryExpr(
      size, size, [&](auto, auto) { return normal(*generator); });
  return A * A.transpose() + MatrixXd::Identity(size, size);
}

// Below, at and above the size of a tile, and of a group of tiles.
TEST(DenseCholesky, SolvesAsAnLuFactorisationDoes) {
  std::mt19937 generator(1);
  for (const int size : {1, 5, 127, 128, 129, 300, 512, 1100}) {
    const MatrixXd matrix = RandomPositiveDefinite(size, &generator);
    const VectorXd rhs = VectorXd::LinSpaced(size, -1, 2);
    MatrixXd lower = matrix;
    lower.triangularView<Eigen::StrictlyUpper>().setConstant(1e300);
    DenseCholesky<double> cholesky;
    ASSERT_TRUE(cholesky.Factorize(lower, 2));
    const VectorXd expected = matrix.partialPivLu().solve(rhs);
    EXPECT_LE((cholesky.Solve(rhs) - expected).norm(), 1e-9 * expected.norm())
        << size;
  }
}

TEST(DenseCholesky, HasTheSameBitsAtAnyNumberOfThreads) {
  std::mt19937 generator(2);
  const MatrixXd matrix = RandomPositiveDefinite(1100, &generator);
  const VectorXd rhs = VectorXd::Ones(1100);
  DenseCholesky<double> cholesky;
  ASSERT_TRUE(cholesky.Factorize(matrix, 1));
  const VectorXd expected = cholesky.Solve(rhs);
  for (const int num_threads : {2, 3, 8}) {
    ASSERT_TRUE(cholesky.Factorize(matrix, num_threads));
    EXPECT_EQ(cholesky.Solve(rhs), expected);
  }
}

TEST(DenseCholesky, RefusesWhatIsNotPositiveDefinite) {
  std::mt19937 generator(3);
  MatrixXd matrix = RandomPositiveDefinite(400, &generator);
  matrix(350, 350) = -1;
  EXPECT_FALSE(DenseCholesky<double>().Factorize(matrix, 2));
}

}  // namespace
}  // namespace krot
