#include "krot/linear/schur_complement.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "tests/linear/random_blocks.h"
#include "tests/oracle/dense_algebra.h"
#include "tests/testing/thread_ranks.h"

namespace krot::internal {
namespace {

// Frame 0 is fixed; point 0 is seen by frame 1 alone, twice, the others by all,
// by frame 1 twice and in falling order.
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

template <typename Rows>
class CentredLeastSquaresTest : public testing::Test {
 protected:
  static constexpr int kRows = Rows::value;
  using System = CentredLeastSquares<kRows>;
  using Block = Eigen::Matrix<double, kRows, 3, Eigen::RowMajor>;

  // Random rows, as large as 10^(-decades u) for u in [0, 1]. A fixed frame's
  // rows are filled like any other's.
  void Fill(double decades, System* system) {
    std::uniform_real_distribution<double> uniform;
    for (int64_t i = 0; i < structure_.num_observations(); ++i) {
      for (int row = 0; row < kRows; ++row) {
        const double scale = std::pow(10, -decades * uniform(generator_));
        for (int c = 0; c < 3; ++c) {
          system->rows(i)[3 * row + c] = scale * normal_(generator_);
        }
      }
    }
  }

  Eigen::VectorXd RandomVector(int64_t size) {
    Eigen::VectorXd x(size);
    for (double& entry : x) entry = normal_(generator_);
    return x;
  }
  Eigen::VectorXd RandomRows() {
    return RandomVector(kRows * structure_.num_observations());
  }
  BlockVector RandomUnknowns() {
    BlockVector x;
    x.SetZero(structure_.num_points(), structure_.num_frames());
    for (int64_t k = 0; k < structure_.num_points(); ++k) {
      if (!structure_.IsFixedPoint(k)) x.points[k] = RandomVector(3);
    }
    for (int64_t f = 1; f < structure_.num_frames(); ++f) {
      x.frames[f] = RandomVector(3);
    }
    return x;
  }

  // Columns of frames but the first, then of points; those of fixed points are
  // 0.
  int64_t num_columns() const {
    return 3 * (structure_.num_points() + structure_.num_frames() - 1);
  }
  LongMatrix DenseA(System* system) const {
    LongMatrix A =
        LongMatrix::Zero(kRows * structure_.num_observations(), num_columns());
    for (int64_t k = 0; k < structure_.num_points(); ++k) {
      for (int64_t i = structure_.point_begin[k];
           i < structure_.point_begin[k + 1]; ++i) {
        const LongMatrix B = Eigen::Map<const Block>(system->rows(i))
                                 .template cast<long double>();
        const int32_t f = structure_.frame_of[i];
        if (f > 0) A.block(kRows * i, 3 * (f - 1), kRows, 3) = -B;
        if (structure_.IsFixedPoint(k)) continue;
        A.block(kRows * i, 3 * (structure_.num_frames() - 1 + k), kRows, 3) = B;
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
    for (const Eigen::Vector3d& point : x.points) {
      stacked.segment<3>(n) = point.cast<long double>();
      n += 3;
    }
    return stacked;
  }

  BlockStructure structure_ = MakeStructure(5, 12);
  std::mt19937 generator_{1};
  std::normal_distribution<double> normal_;
};

using RowCounts = testing::Types<std::integral_constant<int, 3>,
                                 std::integral_constant<int, 4>>;
TYPED_TEST_SUITE(CentredLeastSquaresTest, RowCounts);

TYPED_TEST(CentredLeastSquaresTest, SolvesTheNormalEquationsAsDenseQrDoes) {
  for (int trial = 0; trial < 10; ++trial) {
    // The point that one frame alone sees, too, and another.
    this->structure_.point_is_fixed.assign(12, 0);
    if (trial % 2 == 0) this->structure_.point_is_fixed[0] = 1;
    if (trial % 3 == 0) this->structure_.point_is_fixed[5] = 1;
    CentredLeastSquares<TypeParam::value> system(this->structure_, {1});
    this->Fill(0, &system);
    ASSERT_TRUE(system.Factorize());
    const LongMatrix A = this->DenseA(&system);
    const Eigen::VectorXd r = this->RandomRows();
    const BlockVector g = this->RandomUnknowns();
    for (const bool has_g : {false, true}) {
      for (const bool has_r : {false, true}) {
        BlockVector x;
        Eigen::VectorXd image(r.size());
        system.SolveRefined(has_g ? &g : nullptr, has_r ? r.data() : nullptr,
                            &x, image.data());
        EXPECT_TRUE(x.frames[0].isZero(0));  // the fixed one
        // A'A x = g + A'r.
        LongVector rhs = LongVector::Zero(r.size());
        if (has_r) rhs += r.cast<long double>();
        if (has_g) rhs += LeastNormSolution(A.transpose(), this->Stack(g));
        const LongVector expected = LeastNormSolution(A, rhs);
        EXPECT_LE((this->Stack(x) - expected).norm(), 1e-11L * expected.norm());
        EXPECT_LE((image.cast<long double>() - A * expected).norm(),
                  1e-11L * (A * expected).norm());
        system.Solve(has_g ? &g : nullptr, has_r ? r.data() : nullptr,
                     SchurComplement::kTolerance, &x, nullptr);
        EXPECT_LE((this->Stack(x) - expected).norm(), 1e-9L * expected.norm());
      }
    }
  }
}

// With points that one frame alone sees, or twice.
TYPED_TEST(CentredLeastSquaresTest, SolvesRoughlyWithoutFormingTheSystem) {
  using Solver = typename TestFixture::System;
  this->structure_ = MakeRandomStructure(900, 1);
  Solver exact(this->structure_, {2});
  Solver rough(this->structure_, {2}, Solver::Use::kRoughSolutions);
  Solver one_thread(this->structure_, {1}, Solver::Use::kRoughSolutions);
  this->Fill(0, &exact);
  for (Solver* system : {&exact, &rough, &one_thread}) {
    std::copy_n(exact.rows(0),
                3 * TypeParam::value * this->structure_.num_observations(),
                system->rows(0));
    ASSERT_TRUE(system->Factorize());
  }
  const Eigen::VectorXd r = this->RandomRows();
  Eigen::VectorXd expected(r.size()), image(r.size());
  BlockVector x, same;
  exact.Solve(nullptr, r.data(), SchurComplement::kTolerance, &x,
              expected.data());
  for (const double tolerance : {1e-2, 1e-8}) {
    rough.Solve(nullptr, r.data(), tolerance, &x, image.data());
    // The tolerance is that of an estimate of this norm.
    EXPECT_LT((image - expected).norm(), 5 * tolerance * expected.norm());
    one_thread.Solve(nullptr, r.data(), tolerance, &same, nullptr);
    EXPECT_EQ(x.frames, same.frames);
  }
}

TEST(CentredLeastSquares, OfRanksHasTheBitsOfOneProcessThatFormsNoSystem) {
  const BlockStructure whole = MakeRandomStructure(900, 1);
  std::mt19937 generator(2);
  std::normal_distribution<double> normal;
  std::vector<double> rows(9 * whole.num_observations());
  for (double& entry : rows) entry = normal(generator);
  const auto solve = [&](int64_t begin, int64_t end, Ranks* ranks) {
    const int64_t first = whole.point_begin[begin];
    BlockStructure own = whole;
    own.frame_of = {whole.frame_of.begin() + first,
                    whole.frame_of.begin() + whole.point_begin[end]};
    own.point_begin = {whole.point_begin.begin() + begin,
                       whole.point_begin.begin() + end + 1};
    for (int64_t& n : own.point_begin) n -= first;
    Context context;
    context.ranks = ranks;
    CentredLeastSquares<3> system(own, context,
                                  ReducedCameraSystem::Use::kRoughSolutions);
    std::copy_n(&rows[9 * first], 9 * own.num_observations(), system.rows(0));
    EXPECT_TRUE(system.Factorize());
    BlockVector x;
    system.Solve(nullptr, &rows[3 * first], 1e-3, &x, nullptr);
    return x.frames;
  };
  const std::vector<Eigen::Vector3d> expected =
      solve(0, whole.num_points(), nullptr);
  constexpr int kRanks = 3;
  ThreadRanks::Run(kRanks, [&](Ranks* ranks) {
    const int64_t points = whole.num_points();
    EXPECT_EQ(solve(points * ranks->rank() / kRanks,
                    points * (ranks->rank() + 1) / kRanks, ranks),
              expected);
  });
}

TYPED_TEST(CentredLeastSquaresTest, SolvesForRowsGradedOverEightDecades) {
  for (int trial = 0; trial < 20; ++trial) {
    CentredLeastSquares<TypeParam::value> system(this->structure_, {1});
    this->Fill(8, &system);
    ASSERT_TRUE(system.Factorize());
    // A right-hand side as graded as the rows: all count alike.
    Eigen::VectorXd r = this->RandomRows();
    Eigen::VectorXd Ax(r.size());
    system.Multiply(this->RandomUnknowns(), Ax.data());
    r = Ax.cwiseProduct(Eigen::VectorXd::Ones(r.size()) + 0.1 * r);
    BlockVector x;
    system.SolveRefined(nullptr, r.data(), &x);
    const LongVector expected =
        LeastNormSolution(this->DenseA(&system), r.cast<long double>());
    EXPECT_LT((this->Stack(x) - expected).norm(), 1e-7L * expected.norm());
  }
}

// One row of point 1 in frame 2 outweighs all others by ten orders of magnitude
// and more; frame and point move along each other.
TYPED_TEST(CentredLeastSquaresTest, KeepsWhatOneRowOutweighs) {
  CentredLeastSquares<TypeParam::value> system(this->structure_, {1});
  this->Fill(0, &system);
  Eigen::VectorXd r = this->RandomRows();
  const int64_t i = this->structure_.point_begin[1] + 3;
  for (int c = 0; c < 3; ++c) system.rows(i)[c] *= 1e6;
  r[TypeParam::value * i] *= 1e-3;
  ASSERT_TRUE(system.Factorize());
  BlockVector x;
  const LongVector expected =
      LeastNormSolution(this->DenseA(&system), r.cast<long double>());
  system.Solve(nullptr, r.data(), SchurComplement::kTolerance, &x,
               r.data());  // in place
  EXPECT_LT((this->Stack(x) - expected).norm(), 1e-7L * expected.norm());
}

TYPED_TEST(CentredLeastSquaresTest, MultipliesAsTheDenseMatrixDoes) {
  CentredLeastSquares<TypeParam::value> system(this->structure_, {1});
  this->Fill(0, &system);
  const BlockVector x = this->RandomUnknowns();
  Eigen::VectorXd y = this->RandomRows();
  system.Multiply(x, y.data());
  const LongVector expected = this->DenseA(&system) * this->Stack(x);
  EXPECT_LT((y.cast<long double>() - expected).norm(),
            1e-14L * expected.norm());
}

// A point's rows of rank 2, as those of one ray: where the point lies on it
// does not matter, what the rows come to does.
TYPED_TEST(CentredLeastSquaresTest, LeavesAPointOnItsOnlyRay) {
  CentredLeastSquares<TypeParam::value> system(this->structure_, {1});
  this->Fill(0, &system);
  for (int64_t i = this->structure_.point_begin[3];
       i < this->structure_.point_begin[4]; ++i) {
    for (int row = 0; row < TypeParam::value; ++row) {
      system.rows(i)[3 * row + 2] = 0;
    }
  }
  ASSERT_TRUE(system.Factorize());
  const Eigen::VectorXd r = this->RandomRows();
  BlockVector x;
  Eigen::VectorXd image(r.size());
  system.SolveRefined(nullptr, r.data(), &x, image.data());
  EXPECT_EQ(x.points[3][2], 0);
  const LongMatrix A = this->DenseA(&system);
  const LongVector expected = A * LeastNormSolution(A, r.cast<long double>());
  EXPECT_LT((image.cast<long double>() - expected).norm(),
            1e-11L * expected.norm());
}

TYPED_TEST(CentredLeastSquaresTest, HasTheSameBitsAtAnyNumberOfThreads) {
  this->structure_ = MakeStructure(9, 800);
  const BlockVector g = this->RandomUnknowns();
  const Eigen::VectorXd r = this->RandomRows();
  BlockVector expected;
  for (const int num_threads : {1, 2, 3}) {
    CentredLeastSquares<TypeParam::value> system(this->structure_,
                                                 {num_threads});
    this->generator_.seed(3);
    this->normal_.reset();
    this->Fill(3, &system);
    ASSERT_TRUE(system.Factorize());
    BlockVector x;
    system.SolveRefined(&g, r.data(), &x);
    if (num_threads == 1) expected = x;
    EXPECT_EQ(x.points, expected.points);
    EXPECT_EQ(x.frames, expected.frames);
  }
}

}  // namespace
}  // namespace krot::internal
