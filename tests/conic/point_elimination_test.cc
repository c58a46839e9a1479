#include "krot/conic/point_elimination.h"

#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

namespace krot {
namespace {

using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using LongVector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;

// Every frame sees every point, frame 1 each of them twice; frame 0 is fixed.
BlockStructure MakeStructure(int num_frames, int num_points) {
  BlockStructure structure;
  structure.point_begin = {0};
  for (int k = 0; k < num_points; ++k) {
    structure.frame_of.push_back(1);
    for (int f = 0; f < num_frames; ++f) structure.frame_of.push_back(f);
    structure.point_begin.push_back(
        static_cast<int64_t>(structure.frame_of.size()));
  }
  structure.frame_is_fixed.assign(num_frames, 0);
  structure.frame_is_fixed[0] = 1;
  return structure;
}

template <typename Rows>
class PointEliminationTest : public testing::Test {
 protected:
  static constexpr int kRows = Rows::value;
  using Row = Eigen::Matrix<double, kRows, 3, Eigen::RowMajor>;

  // Random rows, as large as 10^(-decades u) for u in [0, 1]. A fixed frame's
  // rows are filled like any other's.
  void Fill(double decades, PointElimination<kRows>* elimination) {
    for (int64_t i = 0; i < structure_.num_observations(); ++i) {
      const double scale = std::pow(10, -decades * uniform_(generator_));
      for (int n = 0; n < 3 * kRows; ++n) {
        elimination->point_rows(i)[n] = scale * normal_(generator_);
        elimination->frame_rows(i)[n] = scale * normal_(generator_);
      }
    }
  }

  BlockVector RandomUnknowns() {
    BlockVector g;
    g.SetZero(structure_.num_points(), structure_.num_frames());
    for (Eigen::Vector3d& point : g.points) point = RandomVector(3);
    for (int64_t f = 0; f < structure_.num_frames(); ++f) {
      if (!structure_.frame_is_fixed[f]) g.frames[f] = RandomVector(3);
    }
    return g;
  }

  Eigen::VectorXd RandomRows() {
    return RandomVector(kRows * structure_.num_observations());
  }

  // Frames first, then points; a fixed frame's columns are left out.
  int64_t num_columns() const {
    return 3 * (structure_.num_points() + structure_.num_frames() - 1);
  }
  LongMatrix DenseA(PointElimination<kRows>* elimination) const {
    LongMatrix A =
        LongMatrix::Zero(kRows * structure_.num_observations(), num_columns());
    for (int64_t k = 0; k < structure_.num_points(); ++k) {
      for (int64_t i = structure_.point_begin[k];
           i < structure_.point_begin[k + 1]; ++i) {
        const int32_t f = structure_.frame_of[i];
        if (f > 0) {
          A.template block<kRows, 3>(kRows * i, 3 * (f - 1)) =
              Eigen::Map<const Row>(elimination->frame_rows(i))
                  .template cast<long double>();
        }
        A.template block<kRows, 3>(kRows * i,
                                   3 * (structure_.num_frames() - 1 + k)) =
            Eigen::Map<const Row>(elimination->point_rows(i))
                .template cast<long double>();
      }
    }
    return A;
  }
  LongVector Stack(const BlockVector& x) const {
    LongVector stacked(num_columns());
    int64_t n = 0;
    for (int64_t f = 1; f < structure_.num_frames(); ++f, n += 3) {
      stacked.segment<3>(n) = x.frames[f].cast<long double>();
    }
    for (int64_t k = 0; k < structure_.num_points(); ++k, n += 3) {
      stacked.segment<3>(n) = x.points[k].cast<long double>();
    }
    return stacked;
  }

  // x of A'A x = g + A'r by QR. Large rows go first, as graded rows require.
  static LongVector SolveDensely(const LongMatrix& A, const LongVector& g,
                                 const LongVector& r) {
    std::vector<Eigen::Index> order(A.rows());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](Eigen::Index a, Eigen::Index b) {
      return A.row(a).squaredNorm() > A.row(b).squaredNorm();
    });
    LongMatrix sorted(A.rows(), A.cols());
    LongVector rhs(A.rows());
    for (Eigen::Index n = 0; n < A.rows(); ++n) {
      sorted.row(n) = A.row(order[n]);
      rhs[n] = r[order[n]];
    }
    const Eigen::ColPivHouseholderQR<LongMatrix> qr(sorted);
    const auto R =
        qr.matrixR().topRows(A.cols()).template triangularView<Eigen::Upper>();
    const LongMatrix P = qr.colsPermutation();
    LongVector y = P.transpose() * g;
    R.transpose().solveInPlace(y);
    y += (qr.householderQ().transpose() * rhs).head(A.cols());
    R.solveInPlace(y);
    return P * y;
  }

  void Reseed() {
    generator_.seed(1);
    normal_.reset();
    uniform_.reset();
  }

  BlockStructure structure_ = MakeStructure(5, 12);

 private:
  Eigen::VectorXd RandomVector(int64_t size) {
    Eigen::VectorXd x(size);
    for (double& entry : x) entry = normal_(generator_);
    return x;
  }

  std::mt19937 generator_{1};
  std::normal_distribution<double> normal_;
  std::uniform_real_distribution<double> uniform_{0, 1};
};

using RowCounts = testing::Types<std::integral_constant<int, 3>,
                                 std::integral_constant<int, 4>>;
TYPED_TEST_SUITE(PointEliminationTest, RowCounts);

TYPED_TEST(PointEliminationTest, SolvesTheNormalEquationsAsDenseQrDoes) {
  for (int trial = 0; trial < 10; ++trial) {
    PointElimination<TypeParam::value> elimination(this->structure_, 1);
    this->Fill(0, &elimination);
    const BlockVector g = this->RandomUnknowns();
    const Eigen::VectorXd r = this->RandomRows();
    ASSERT_TRUE(elimination.Factorize());
    BlockVector x;
    elimination.Solve(g, r.data(), &x);
    EXPECT_EQ(x.frames[0].norm(), 0);  // the fixed one
    const LongMatrix A = this->DenseA(&elimination);
    const LongVector expected =
        this->SolveDensely(A, this->Stack(g), r.cast<long double>());
    EXPECT_LT((this->Stack(x) - expected).norm(), 1e-12L * expected.norm());

    elimination.Solve(g, nullptr, &x);
    const LongVector without_r =
        this->SolveDensely(A, this->Stack(g), LongVector::Zero(A.rows()));
    EXPECT_LT((this->Stack(x) - without_r).norm(), 1e-12L * without_r.norm());
  }
}

TYPED_TEST(PointEliminationTest, SolvesForRowsGradedOverEightDecades) {
  for (int trial = 0; trial < 20; ++trial) {
    PointElimination<TypeParam::value> elimination(this->structure_, 1);
    this->Fill(8, &elimination);
    BlockVector zero;
    zero.SetZero(this->structure_.num_points(), this->structure_.num_frames());
    ASSERT_TRUE(elimination.Factorize());
    // A right-hand side as graded as the rows: all count alike.
    const BlockVector x_true = this->RandomUnknowns();
    Eigen::VectorXd r = this->RandomRows();
    Eigen::VectorXd Ax(r.size());
    elimination.Multiply(x_true, Ax.data());
    r = Ax.cwiseProduct(Eigen::VectorXd::Ones(r.size()) + 0.1 * r);
    BlockVector x;
    elimination.Solve(zero, r.data(), &x);
    const LongVector expected = this->SolveDensely(
        this->DenseA(&elimination), this->Stack(zero), r.cast<long double>());
    EXPECT_LT((this->Stack(x) - expected).norm(), 1e-7L * expected.norm());
  }
}

TYPED_TEST(PointEliminationTest, MultipliesAsTheDenseMatrixDoes) {
  PointElimination<TypeParam::value> elimination(this->structure_, 1);
  this->Fill(0, &elimination);
  const BlockVector x = this->RandomUnknowns();
  Eigen::VectorXd y = this->RandomRows();
  elimination.Multiply(x, y.data());
  const LongVector expected = this->DenseA(&elimination) * this->Stack(x);
  EXPECT_LT((y.cast<long double>() - expected).norm(),
            1e-14L * expected.norm());
}

// A point's rows of rank 2, as those of one ray: where the point lies on it
// does not matter, what the rows come to does.
TYPED_TEST(PointEliminationTest, LeavesAPointOnItsOnlyRay) {
  BlockStructure& structure = this->structure_;
  structure.frame_of.push_back(2);  // sees a last point, alone
  structure.point_begin.push_back(structure.num_observations() + 1);
  PointElimination<TypeParam::value> elimination(structure, 1);
  this->Fill(0, &elimination);
  double* rows = elimination.point_rows(structure.num_observations() - 1);
  for (int r = 0; r < TypeParam::value; ++r) {
    rows[3 * r + 2] = -rows[3 * r];  // nothing changes along (1, 0, 1)
  }
  ASSERT_TRUE(elimination.Factorize());
  BlockVector zero;
  zero.SetZero(structure.num_points(), structure.num_frames());
  const Eigen::VectorXd r = this->RandomRows();
  BlockVector x;
  elimination.Solve(zero, r.data(), &x);
  const LongMatrix A = this->DenseA(&elimination);
  const LongVector expected =
      A * A.completeOrthogonalDecomposition().solve(r.cast<long double>());
  EXPECT_LT((A * this->Stack(x) - expected).norm(), 1e-12L * expected.norm());
  EXPECT_LT(this->Stack(x).norm(), 1e3L);
}

TYPED_TEST(PointEliminationTest, HasTheSameBitsAtAnyNumberOfThreads) {
  this->structure_ = MakeStructure(6, 50);
  const BlockVector g = this->RandomUnknowns();
  const Eigen::VectorXd r = this->RandomRows();
  BlockVector expected;
  for (const int num_threads : {1, 2, 3}) {
    PointElimination<TypeParam::value> elimination(this->structure_,
                                                   num_threads);
    this->Reseed();
    this->Fill(3, &elimination);
    ASSERT_TRUE(elimination.Factorize());
    BlockVector x;
    elimination.Solve(g, r.data(), &x);
    if (num_threads == 1) expected = x;
    EXPECT_EQ(x.points, expected.points);
    EXPECT_EQ(x.frames, expected.frames);
  }
}

}  // namespace
}  // namespace krot
