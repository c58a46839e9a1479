#include "krot/linear/reduced_camera_system.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "krot/linear/blocks.h"
#include "krot/linear/native_kernels.h"
#include "tests/linear/random_blocks.h"
#include "tests/oracle/dense_algebra.h"

namespace krot::internal {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
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

using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

// Rows as large as 10^(-8 u), u uniform in [0, 1]; the third column differs
// from the sum of the others by `apart` of its size.
Columns GradedRows(int64_t n, double apart, unsigned seed) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0, 1);
  Columns A(n, 3);
  for (int64_t i = 0; i < n; ++i) {
    for (int c = 0; c < 3; ++c) A(i, c) = normal(generator);
    A(i, 2) = A(i, 0) + A(i, 1) + apart * A(i, 2);
    A.row(i) *= std::pow(10, -8 * uniform(generator));
  }
  return A;
}

Matrix3d Dense(const UpperTriangle& R) {
  Matrix3d dense;
  dense << R.r00, R.r01, R.r02, 0, R.r11, R.r12, 0, 0, R.r22;
  return dense;
}

TEST(ThinQr, HasOrthonormalColumnsThatGiveBackTheMatrix) {
  for (unsigned seed = 1; seed <= 200; ++seed) {
    const double apart = std::pow(10, -static_cast<double>(seed % 10));
    const Columns A = GradedRows(6 + seed % 50, apart, seed);
    Columns Q = A;
    const Matrix3d R = Dense(Orthogonalize(Q.rows(), Q.data()));
    EXPECT_LT((Q.transpose() * Q - Matrix3d::Identity()).norm(), 1e-14);
    EXPECT_LT((Q * R - A).norm(), 1e-15 * A.norm());
  }
}

TEST(ThinQr, GivesNoColumnToACombinationOfTheOthers) {
  Columns A = GradedRows(20, 1, 1);
  A.col(1) = -2 * A.col(0);
  Columns Q = A;
  const UpperTriangle R = Orthogonalize(Q.rows(), Q.data());
  EXPECT_EQ(Q.col(1).norm(), 0);
  EXPECT_TRUE(std::isinf(R.r11));
  EXPECT_NEAR(Q.col(0).norm(), 1, 1e-15);
  EXPECT_NEAR(Q.col(2).norm(), 1, 1e-15);
  EXPECT_EQ(R.Solve(Vector3d::Ones())[1], 0);
  EXPECT_EQ(R.SolveTransposed(Vector3d::Ones())[1], 0);
}

TEST(ThinQr, SolvesWithTheTriangleAndItsTranspose) {
  const UpperTriangle R{2, -3, 0.5, 0.25, 7, -4};
  const Vector3d b(1, -2, 3);
  EXPECT_LT((Dense(R) * R.Solve(b) - b).norm(), 1e-14);
  EXPECT_LT((Dense(R).transpose() * R.SolveTransposed(b) - b).norm(), 1e-14);
}

TEST(InvertCholesky, GivesTheInverseOfTheFactor) {
  const Columns A = GradedRows(10, 1, 7);
  const Matrix3d H = A.transpose() * A;
  Matrix3d inverse;
  EXPECT_TRUE(InvertCholesky(H, 1e-14 * H.trace(), &inverse));
  EXPECT_LT((inverse * H * inverse.transpose() - Matrix3d::Identity()).norm(),
            1e-9);
  EXPECT_TRUE(inverse.isLowerTriangular());
}

TEST(InvertCholesky, ReplacesPivotsThatAreTooSmallAndSaysSo) {
  const Matrix3d H = Vector3d(4, 1, 0).asDiagonal();
  Matrix3d inverse;
  EXPECT_FALSE(InvertCholesky(H, 0.25, &inverse));
  EXPECT_LT((inverse.diagonal() - Vector3d(0.5, 1, 2)).norm(), 1e-15);
}

}  // namespace
}  // namespace krot::internal
