#include "krot/finish/centre_elimination.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Dense>

namespace krot {
namespace {

using LongMatrix = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
using LongVector = Eigen::Matrix<long double, Eigen::Dynamic, 1>;
using RowMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// Frame 0 is fixed; point 0 is seen by frame 1 alone, the others by all, by
// frame 1 twice and in falling order.
BlockStructure MakeStructure(int num_frames, int num_points) {
  BlockStructure structure;
  structure.point_begin = {0};
  for (int k = 0; k < num_points; ++k) {
    structure.frame_of.push_back(1);
    if (k == 0) structure.frame_of.push_back(1);
    for (int f = num_frames - 1; k > 0 && f >= 0; --f) {
      structure.frame_of.push_back(f);
    }
    structure.point_begin.push_back(
        static_cast<int64_t>(structure.frame_of.size()));
  }
  structure.frame_is_fixed.assign(num_frames, 0);
  structure.frame_is_fixed[0] = 1;
  return structure;
}

class CentreEliminationTest : public testing::Test {
 protected:
  // Random rows, as large as 10^(decades u) for u in [0, 1], and right-hand
  // sides.
  void Fill(double decades, CentreElimination* elimination) {
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform;
    r_.resize(3 * structure_.num_observations());
    for (double& number : r_) number = normal(generator_);
    for (int64_t i = 0; i < structure_.num_observations(); ++i) {
      for (int row = 0; row < 3; ++row) {
        const double scale = std::pow(10, decades * uniform(generator_));
        for (int c = 0; c < 3; ++c) {
          elimination->rows(i)[3 * row + c] = scale * normal(generator_);
        }
      }
    }
  }

  // Frames but the first, then points.
  LongMatrix DenseA(CentreElimination* elimination) const {
    const int64_t num_free = structure_.num_frames() - 1;
    LongMatrix A = LongMatrix::Zero(3 * structure_.num_observations(),
                                    3 * (num_free + structure_.num_points()));
    for (int64_t k = 0; k < structure_.num_points(); ++k) {
      for (int64_t i = structure_.point_begin[k];
           i < structure_.point_begin[k + 1]; ++i) {
        const LongMatrix B = Eigen::Map<const RowMatrix3>(elimination->rows(i))
                                 .cast<long double>();
        const int32_t f = structure_.frame_of[i];
        if (f > 0) A.block(3 * i, 3 * (f - 1), 3, 3) = -B;
        if (structure_.IsFixedPoint(k)) continue;
        A.block(3 * i, 3 * (num_free + k), 3, 3) = B;
      }
    }
    return A;
  }

  // By Cholesky's method in twice the digits, which the normal equations need.
  LongVector DenseSolution(const LongMatrix& A, const LongVector& r) const {
    return (A.transpose() * A).ldlt().solve(A.transpose() * r);
  }

  LongVector Unknowns(const BlockVector& x) const {
    LongVector all(3 * (structure_.num_frames() - 1 + structure_.num_points()));
    int64_t n = 0;
    for (int64_t f = 1; f < structure_.num_frames(); ++f) {
      for (int c = 0; c < 3; ++c) all[n++] = x.frames[f][c];
    }
    for (const Eigen::Vector3d& point : x.points) {
      for (int c = 0; c < 3; ++c) all[n++] = point[c];
    }
    return all;
  }

  BlockStructure structure_ = MakeStructure(5, 12);
  std::mt19937 generator_{7};
  std::vector<double> r_;
};

TEST_F(CentreEliminationTest, SolvesTheLeastSquares) {
  for (const double decades : {0.0, 2.0, 4.0}) {
    // The point that one frame alone sees, too, and another.
    structure_.point_is_fixed.assign(structure_.num_points(), 0);
    if (decades == 0) structure_.point_is_fixed[0] = 1;
    if (decades < 4) structure_.point_is_fixed[5] = 1;
    CentreElimination elimination(structure_, {1});
    Fill(decades, &elimination);
    const LongMatrix A = DenseA(&elimination);
    const LongVector r = Eigen::Map<const Eigen::VectorXd>(
                             r_.data(), static_cast<Eigen::Index>(r_.size()))
                             .cast<long double>();
    const LongVector expected = DenseSolution(A, r);
    ASSERT_TRUE(elimination.Factorize());
    BlockVector x;
    elimination.Solve(r_.data(), &x);
    EXPECT_TRUE(x.frames[0].isZero(0));
    const LongVector solution = Unknowns(x);
    EXPECT_LT((solution - expected).norm(), 1e-8L * expected.norm()) << decades;
    const LongVector moved = A * solution;
    for (Eigen::Index n = 0; n < moved.size(); ++n) {
      EXPECT_NEAR(
          r_[n], static_cast<double>(moved[n]),
          1e-10 * std::pow(10, decades) * static_cast<double>(solution.norm()));
    }
  }
}

// One row of point 1 in frame 2 outweighs all others by ten orders of magnitude
// and more; frame and point move along each other.
TEST_F(CentreEliminationTest, KeepsWhatOneRowOutweighs) {
  CentreElimination elimination(structure_, {1});
  Fill(0, &elimination);
  const int64_t i = structure_.point_begin[1] + 3;
  for (int c = 0; c < 3; ++c) elimination.rows(i)[c] *= 1e6;
  r_[3 * i] *= 1e-3;
  const LongVector r = Eigen::Map<const Eigen::VectorXd>(
                           r_.data(), static_cast<Eigen::Index>(r_.size()))
                           .cast<long double>();
  const LongVector expected = DenseSolution(DenseA(&elimination), r);
  ASSERT_TRUE(elimination.Factorize());
  BlockVector x;
  elimination.Solve(r_.data(), &x);
  EXPECT_LT((Unknowns(x) - expected).norm(), 1e-7L * expected.norm());
}

TEST_F(CentreEliminationTest, LeavesADirectionThatNoRowTells) {
  CentreElimination elimination(structure_, {1});
  Fill(0, &elimination);
  for (int64_t i = structure_.point_begin[3]; i < structure_.point_begin[4];
       ++i) {
    for (int row = 0; row < 3; ++row) elimination.rows(i)[3 * row + 2] = 0;
  }
  ASSERT_TRUE(elimination.Factorize());
  BlockVector x;
  elimination.Solve(r_.data(), &x);
  EXPECT_EQ(x.points[3][2], 0);
  EXPECT_TRUE(Unknowns(x).allFinite());
}

TEST_F(CentreEliminationTest, HasTheSameBitsAtAnyNumberOfThreads) {
  const BlockStructure structure = MakeStructure(9, 800);
  std::vector<double> expected;
  for (const int num_threads : {1, 2, 3}) {
    CentreElimination elimination(structure, {num_threads});
    std::mt19937 generator(3);
    std::normal_distribution<double> normal;
    for (int64_t n = 0; n < 9 * structure.num_observations(); ++n) {
      elimination.rows(0)[n] = normal(generator);
    }
    std::vector<double> r(3 * structure.num_observations());
    for (double& number : r) number = normal(generator);
    ASSERT_TRUE(elimination.Factorize());
    BlockVector x;
    elimination.Solve(r.data(), &x);
    if (num_threads == 1) expected = r;
    EXPECT_EQ(r, expected);
  }
}

}  // namespace
}  // namespace krot
