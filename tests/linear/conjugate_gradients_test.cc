#include "krot/linear/reduced_camera_system.h"

#include <gtest/gtest.h>

#include "tests/linear/random_blocks.h"
#include "tests/oracle/dense_algebra.h"

namespace krot::internal {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// (L L')^-1.
MatrixXd InverseOf(const IncompleteCholesky& factor, Index n) {
  MatrixXd inverse(n, n);
  for (Index k = 0; k < n; ++k) {
    inverse.col(k) = factor.Solve(Eigen::VectorXf::Unit(n, k)).cast<double>();
  }
  return inverse;
}

// Its blocks on the diagonal as the identity.
MatrixXd Whitened(const MatrixXd& matrix) {
  MatrixXd L = MatrixXd::Zero(matrix.rows(), matrix.cols());
  for (Index k = 0; k < matrix.rows(); k += 3) {
    L.block<3, 3>(k, k) = CholeskyFactor(matrix.block<3, 3>(k, k));
  }
  return SolveByLu(L, SolveByLu(L, matrix).transpose());
}

// Of the eigenvalues of `inverse` `matrix`.
double Condition(const MatrixXd& inverse, const MatrixXd& matrix) {
  const MatrixXd L = CholeskyFactor(matrix);
  const VectorXd values = EigenOfSymmetric(L.transpose() * inverse * L).values;
  return values.maxCoeff() / values.minCoeff();
}

// A chain has one block below the diagonal, and half of that rounds up.
TEST(IncompleteCholesky, IsExactWhereNothingIsDropped) {
  constexpr int kFrames = 20;
  MatrixXd chain = MatrixXd::Identity(3 * kFrames, 3 * kFrames);
  for (int k = 0; k + 3 < chain.rows(); k += 3) {
    const Eigen::Matrix3d block =
        0.1 * Eigen::Matrix3d::Ones() +
        0.05 * Eigen::Vector3d(1, 2, -k % 5).asDiagonal().toDenseMatrix();
    chain.block<3, 3>(k + 3, k) = block;
    chain.block<3, 3>(k, k + 3) = block.transpose();
  }
  const BlockMatrix system(chain);
  IncompleteCholesky factor;
  ASSERT_TRUE(factor.Factorize(system.pattern, system.blocks));
  const MatrixXd product = InverseOf(factor, chain.rows()) * chain;
  EXPECT_LT((product - MatrixXd::Identity(chain.rows(), chain.rows())).norm(),
            1e-4);
}

TEST(IncompleteCholesky, BringsEigenvaluesTogether) {
  for (const double decades : {0, 3}) {
    const BlockMatrix system(
        Whitened(RandomNormalEquations(200, 600, decades, 1e-2)));
    IncompleteCholesky factor;
    ASSERT_TRUE(factor.Factorize(system.pattern, system.blocks));
    const Index n = system.matrix.rows();
    const MatrixXd inverse = InverseOf(factor, n);
    EXPECT_LT((inverse - inverse.transpose()).norm(), 1e-3 * inverse.norm());
    EXPECT_LT(2 * Condition(inverse, system.matrix),
              Condition(MatrixXd::Identity(n, n), system.matrix))
        << decades;
  }
}

TEST(IncompleteCholesky, ShiftsWhatIsNotPositiveDefiniteUpToALimit) {
  MatrixXd matrix = Whitened(RandomNormalEquations(30, 300, 2, 1e-2));
  matrix.diagonal().array() -= 0.9;
  BlockMatrix system(matrix);
  IncompleteCholesky factor;
  ASSERT_TRUE(factor.Factorize(system.pattern, system.blocks));
  const MatrixXd inverse = InverseOf(factor, matrix.rows());
  EXPECT_GT(EigenOfSymmetric(inverse).values.minCoeff(), 0);
  system.blocks[0](0, 0) = -100;
  EXPECT_FALSE(factor.Factorize(system.pattern, system.blocks));
}

// A few of their pairs share points.
constexpr int kManyFrames = 700;

// |x - A^-1 b| in the energy norm, relative.
double EnergyError(const MatrixXd& A, const VectorXd& b, const VectorXd& x) {
  const VectorXd exact = SolveByLu(A, b);
  const VectorXd error = x - exact;
  return std::sqrt(error.dot(A * error) / exact.dot(b));
}

TEST(ConjugateGradients, SolvesToTheToleranceOrSaysThatItDoesNot) {
  for (const double decades : {0, 4, 8}) {
    const BlockMatrix full(RandomNormalEquations(40, 800, decades, 1e-3));
    const BlockMatrix sparse(
        RandomNormalEquations(kManyFrames, 1500, decades, 1e-3));
    for (const BlockMatrix* system : {&full, &sparse}) {
      for (const bool has_factor : {true, false}) {
        ConjugateGradients solver;
        ASSERT_TRUE(
            solver.Factorize(system->pattern, system->blocks, 2, has_factor));
        const VectorXd rhs = VectorXd::LinSpaced(system->matrix.rows(), -1, 2);
        for (const double tolerance : {1e-3, 1e-6}) {
          VectorXd x;
          if (!solver.Solve(rhs, tolerance, &x)) {  // in single precision
            EXPECT_EQ(decades, 8);
            continue;
          }
          EXPECT_LT(EnergyError(system->matrix, rhs, x), 10 * tolerance)
              << decades << (has_factor ? "" : ", without a factor");
        }
      }
    }
  }
}

TEST(ConjugateGradients, HasTheSameBitsAtAnyNumberOfThreads) {
  const BlockMatrix system(RandomNormalEquations(kManyFrames, 1500, 4, 1e-3));
  const VectorXd rhs = VectorXd::Ones(system.matrix.rows());
  const auto solve = [&](int num_threads) {
    ConjugateGradients solver;
    EXPECT_TRUE(solver.Factorize(system.pattern, system.blocks, num_threads));
    VectorXd x;
    EXPECT_TRUE(solver.Solve(rhs, 1e-8, &x));
    return x;
  };
  const VectorXd expected = solve(1);
  for (const int num_threads : {2, 3, 8}) {
    EXPECT_EQ(solve(num_threads), expected);
  }
}

TEST(ConjugateGradients, LeavesAFrameWithoutRowsWhereItIs) {
  MatrixXd matrix = RandomNormalEquations(40, 400, 0, 1e-3);
  matrix.rightCols<3>().setZero();
  matrix.bottomRows<3>().setZero();
  const BlockMatrix system(matrix);
  ConjugateGradients solver;
  ASSERT_TRUE(solver.Factorize(system.pattern, system.blocks, 1));
  VectorXd rhs = VectorXd::Ones(120);
  rhs.tail<3>().setZero();
  VectorXd x;
  ASSERT_TRUE(solver.Solve(rhs, 1e-8, &x));
  EXPECT_LT((matrix * x - rhs).norm(), 1e-6 * rhs.norm());
  EXPECT_EQ(x.tail<3>().norm(), 0);
  ASSERT_TRUE(solver.Solve(VectorXd::Zero(120), 1e-8, &x));
  EXPECT_EQ(x.norm(), 0);
}

}  // namespace
}  // namespace krot::internal
