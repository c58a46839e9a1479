#include "krot/linear/blocks.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
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
