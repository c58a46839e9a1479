#include "krot/proof/dual_repair.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/oracle/dense_algebra.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Every point is seen by every frame, once or twice.
LeastNormProblem RandomProblem(bool has_last_row) {
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  const auto random = [&](auto, auto) { return normal(generator); };
  LeastNormProblem problem;
  problem.num_points = 12;
  problem.num_frames = 5;
  problem.has_last_row = has_last_row;
  for (int32_t k = 0; k < problem.num_points; ++k) {
    for (int32_t n = 0; n < problem.num_frames + 1; ++n) {
      LeastNormProblem::Columns columns;
      columns.point = k;
      columns.frame = n % problem.num_frames;
      columns.rows = Matrix3d::NullaryExpr(random);
      if (has_last_row) {
        columns.last_row = Matrix3d::NullaryExpr(random).col(0);
      }
      problem.columns.push_back(columns);
    }
  }
  return problem;
}

// A row per equation; frame 0 has none.
MatrixXd Dense(const LeastNormProblem& problem) {
  MatrixXd M = MatrixXd::Zero(problem.num_rows(), 3 * problem.columns.size());
  int64_t i = 0;
  for (const LeastNormProblem::Columns& c : problem.columns) {
    M.block<3, 3>(3 * c.point, i) = c.rows.transpose();
    if (c.frame > 0) {
      M.block<3, 3>(3 * (problem.num_points + c.frame - 1), i) =
          -c.rows.transpose();
    }
    if (problem.has_last_row) {
      M.block<1, 3>(M.rows() - 1, i) = c.last_row.transpose();
    }
    i += 3;
  }
  return M;
}

// By the dense equations M.
void ExpectLeastNorm(const LeastNormProblem& problem, const MatrixXd& M) {
  const VectorXd rhs = VectorXd::LinSpaced(M.rows(), -1, 3);
  const VectorXd expected =
      LeastNormSolution(M.cast<long double>(), rhs.cast<long double>())
          .cast<double>();
  LeastNormSolver solver(1);
  ASSERT_TRUE(solver.Factorize(problem));
  EXPECT_LE((solver.Solve(rhs) - expected).norm(), 1e-10);
}

TEST(LeastNormSolver, FindsWhatAnOrthogonalDecompositionFinds) {
  for (const bool has_last_row : {false, true}) {
    const LeastNormProblem problem = RandomProblem(has_last_row);
    ExpectLeastNorm(problem, Dense(problem));
  }
}

// Their equations share nothing with others.
TEST(LeastNormSolver, KnowsPointsThatOnlyTheFrameWithoutEquationsSees) {
  LeastNormProblem problem = RandomProblem(false);
  for (LeastNormProblem::Columns& c : problem.columns) {
    if (c.point == 4 || c.point == 11) c.frame = 0;
  }
  ExpectLeastNorm(problem, Dense(problem));
}

TEST(LeastNormSolver, LeavesOutTheEquationsOfFixedPoints) {
  for (const bool has_last_row : {false, true}) {
    LeastNormProblem problem = RandomProblem(has_last_row);
    const MatrixXd all = Dense(problem);
    problem.point_is_fixed.assign(problem.num_points, 0);
    problem.point_is_fixed[0] = problem.point_is_fixed[7] = 1;
    ASSERT_EQ(problem.num_rows(), all.rows() - 6);
    MatrixXd M(problem.num_rows(), all.cols());
    M << all.middleRows(3, 18), all.bottomRows(all.rows() - 24);
    ExpectLeastNorm(problem, M);
  }
}

TEST(LeastNormSolver, RefusesEquationsThatMayHaveNoSolution) {
  LeastNormProblem few = RandomProblem(false);
  few.columns.resize(3);
  LeastNormProblem repeated = RandomProblem(true);
  for (LeastNormProblem::Columns& c : repeated.columns) {
    c.last_row.setZero();
    if (c.point == 3) c.last_row = c.rows.col(1);
  }
  EXPECT_FALSE(LeastNormSolver(1).Factorize(few));
  EXPECT_FALSE(LeastNormSolver(1).Factorize(repeated));
}

}  // namespace
}  // namespace krot::internal
