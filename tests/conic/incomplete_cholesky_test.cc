#include "krot/conic/incomplete_cholesky.h"

#include <gtest/gtest.h>
#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "tests/conic/block_matrix.h"

namespace krot {
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
MatrixXd Whitened(MatrixXd matrix) {
  for (Index k = 0; k < matrix.rows(); k += 3) {
    const Eigen::LLT<Eigen::Matrix3d> llt(matrix.block<3, 3>(k, k));
    const Eigen::Matrix3d W = llt.matrixL().solve(Eigen::Matrix3d::Identity());
    matrix.middleRows<3>(k) = (W * matrix.middleRows<3>(k)).eval();
    matrix.middleCols<3>(k) = (matrix.middleCols<3>(k) * W.transpose()).eval();
  }
  return matrix;
}

// Of the eigenvalues of `inverse` `matrix`.
double Condition(const MatrixXd& inverse, const MatrixXd& matrix) {
  const MatrixXd L = matrix.llt().matrixL();
  const VectorXd eigenvalues =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(L.transpose() * inverse * L)
          .eigenvalues();
  return eigenvalues.maxCoeff() / eigenvalues.minCoeff();
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
  EXPECT_GT(
      Eigen::SelfAdjointEigenSolver<MatrixXd>(inverse).eigenvalues().minCoeff(),
      0);
  system.blocks[0](0, 0) = -100;
  EXPECT_FALSE(factor.Factorize(system.pattern, system.blocks));
}

}  // namespace
}  // namespace krot
