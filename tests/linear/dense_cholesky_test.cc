#include "krot/linear/native_kernels.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/oracle/dense_algebra.h"

namespace krot::internal {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

MatrixXd RandomPositiveDefinite(int size, std::mt19937* generator) {
  std::normal_distribution<double> normal;
  const MatrixXd A = MatrixXd::NullaryExpr(
      size, size, [&](auto, auto) { return normal(*generator); });
  return A * A.transpose() + MatrixXd::Identity(size, size);
}

bool Factorize(const MatrixXd& matrix, int num_threads,
               DenseCholesky* cholesky) {
  cholesky->SetZero(matrix.rows());
  for (int64_t c = 0; c < matrix.cols(); ++c) {
    cholesky->SetRun(c, c, matrix.rows() - c, &matrix(c, c));
  }
  return cholesky->Factorize(num_threads);
}

VectorXd Solve(const DenseCholesky& cholesky, VectorXd x) {
  cholesky.Solve(x.data());
  return x;
}

// Below, at and above the size of a tile.
TEST(DenseCholesky, SolvesAsAnLuFactorisationDoes) {
  std::mt19937 generator(1);
  for (const int size : {1, 5, 127, 128, 129, 300, 512, 1100}) {
    const MatrixXd matrix = RandomPositiveDefinite(size, &generator);
    const VectorXd rhs = VectorXd::LinSpaced(size, -1, 2);
    DenseCholesky cholesky;
    ASSERT_TRUE(Factorize(matrix, 2, &cholesky));
    const VectorXd expected = SolveByLu(matrix, rhs);
    EXPECT_LE((Solve(cholesky, rhs) - expected).norm(), 1e-9 * expected.norm())
        << size;
  }
}

TEST(DenseCholesky, HasTheSameBitsAtAnyNumberOfThreads) {
  std::mt19937 generator(2);
  const MatrixXd matrix = RandomPositiveDefinite(1100, &generator);
  const VectorXd rhs = VectorXd::Ones(1100);
  DenseCholesky cholesky;
  ASSERT_TRUE(Factorize(matrix, 1, &cholesky));
  const VectorXd expected = Solve(cholesky, rhs);
  for (const int num_threads : {2, 3, 8}) {
    ASSERT_TRUE(Factorize(matrix, num_threads, &cholesky));
    EXPECT_EQ(Solve(cholesky, rhs), expected);
  }
}

TEST(DenseCholesky, RefusesWhatIsNotPositiveDefinite) {
  std::mt19937 generator(3);
  MatrixXd matrix = RandomPositiveDefinite(400, &generator);
  matrix(350, 350) = -1;
  DenseCholesky cholesky;
  EXPECT_FALSE(Factorize(matrix, 2, &cholesky));
}

}  // namespace
}  // namespace krot::internal
