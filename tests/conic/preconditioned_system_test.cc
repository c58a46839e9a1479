#include "krot/conic/preconditioned_system.h"

#include <gtest/gtest.h>
#include <Eigen/Cholesky>

#include "tests/conic/block_matrix.h"

namespace krot {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// A few of their pairs share points.
constexpr int kManyFrames = 700;

// |x - A^-1 b| in the energy norm, relative.
double EnergyError(const MatrixXd& A, const VectorXd& b, const VectorXd& x) {
  const VectorXd exact = A.ldlt().solve(b);
  const VectorXd error = x - exact;
  return std::sqrt(error.dot(A * error) / exact.dot(b));
}

TEST(PreconditionedSystem, SolvesToTheTolerance) {
  for (const double decades : {0, 4, 8}) {
    const BlockMatrix full(RandomNormalEquations(40, 800, decades, 1e-3));
    const BlockMatrix sparse(
        RandomNormalEquations(kManyFrames, 1500, decades, 1e-3));
    for (const BlockMatrix* system : {&full, &sparse}) {
      PreconditionedSystem solver(system->pattern);
      ASSERT_TRUE(solver.Factorize(system->blocks, 2));
      const VectorXd rhs = VectorXd::LinSpaced(system->matrix.rows(), -1, 2);
      for (const double tolerance : {1e-3, 1e-6}) {
        const VectorXd x = solver.Solve(rhs, tolerance);
        EXPECT_LT(EnergyError(system->matrix, rhs, x), 10 * tolerance)
            << decades;
      }
    }
  }
}

// Every hundredth pair of 20,000 frames; all of 40.
TEST(PreconditionedSystem, BeginsWithWhatIsPredictedToBeCheapest) {
  const BlockMatrix full(RandomNormalEquations(40, 800, 0, 1));
  EXPECT_EQ(PreconditionedSystem(full.pattern).preconditioner(),
            Preconditioner::kSingle);
  BlockPattern large;
  constexpr int32_t kFrames = 20000;
  for (int32_t j = 0; j < kFrames; ++j) {
    for (int32_t i = j; i < kFrames; i += 100) large.row.push_back(i);
    large.begin.push_back(large.num_blocks());
  }
  EXPECT_EQ(PreconditionedSystem(large).preconditioner(),
            Preconditioner::kIncomplete);
}

// Some directions are weaker than the others by more than single precision
// knows.
TEST(PreconditionedSystem, TakesAnExacterFactorWhereIterationsAreMany) {
  MatrixXd matrix = RandomNormalEquations(60, 600, 4, 1e-3);
  for (int k = 0; k < 12; ++k) {
    const VectorXd weak =
        VectorXd::LinSpaced(matrix.rows(), k, 1 + 5 * k).array().sin();
    const VectorXd image = matrix * weak;
    const double rest = 1 - std::pow(0.1, 6 + k / 2);
    matrix -= rest / weak.dot(image) * image * image.transpose();
  }
  const BlockMatrix system(matrix);
  PreconditionedSystem solver(system.pattern);
  const VectorXd x_true = VectorXd::LinSpaced(matrix.rows(), -1, 3);
  const VectorXd rhs = matrix * x_true;
  ASSERT_TRUE(solver.Factorize(system.blocks, 1));
  ASSERT_EQ(solver.preconditioner(), Preconditioner::kSingle);
  solver.Solve(rhs, 1e-10);
  const int num_in_single = solver.num_iterations();
  ASSERT_TRUE(solver.Factorize(system.blocks, 1));
  EXPECT_EQ(solver.preconditioner(), Preconditioner::kDouble);
  const VectorXd x = solver.Solve(rhs, 1e-10);
  EXPECT_LT((matrix * x - rhs).norm(), 1e-9 * rhs.norm());
  EXPECT_LT(solver.num_iterations(), num_in_single);
}

TEST(PreconditionedSystem, HasTheSameBitsAtAnyNumberOfThreads) {
  const BlockMatrix system(RandomNormalEquations(kManyFrames, 1500, 4, 1e-3));
  const VectorXd rhs = VectorXd::Ones(system.matrix.rows());
  const auto solve = [&](int num_threads) {
    PreconditionedSystem solver(system.pattern);
    EXPECT_TRUE(solver.Factorize(system.blocks, num_threads));
    return solver.Solve(rhs, 1e-8);
  };
  const VectorXd expected = solve(1);
  for (const int num_threads : {2, 3, 8}) {
    EXPECT_EQ(solve(num_threads), expected);
  }
}

TEST(PreconditionedSystem, LeavesAFrameWithoutRowsWhereItIs) {
  MatrixXd matrix = RandomNormalEquations(40, 400, 0, 1e-3);
  matrix.rightCols<3>().setZero();
  matrix.bottomRows<3>().setZero();
  const BlockMatrix system(matrix);
  PreconditionedSystem solver(system.pattern);
  ASSERT_TRUE(solver.Factorize(system.blocks, 1));
  VectorXd rhs = VectorXd::Ones(120);
  rhs.tail<3>().setZero();
  const VectorXd x = solver.Solve(rhs, 1e-8);
  EXPECT_LT((matrix * x - rhs).norm(), 1e-6 * rhs.norm());
  EXPECT_EQ(x.tail<3>().norm(), 0);
  EXPECT_EQ(solver.Solve(VectorXd::Zero(120), 1e-8).norm(), 0);
}

}  // namespace
}  // namespace krot
