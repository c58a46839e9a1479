// The rivals on the whole problem against a certified bound.

#include <cmath>

#include <gtest/gtest.h>

#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "tools/benchmark/rivals/full_rivals.h"
#include "tools/benchmark/synthetic_model.h"

namespace krot::internal {
namespace {

constexpr ModelSize kSmall = {"small", 6, 60, 240};

double SumOfSquares(const KnownRotationProblem& problem,
                    const Estimate& estimate) {
  double sum = 0;
  for (const Observation& observation : problem.observations) {
    const ViewedPoint viewed = ViewPoint(problem, observation, estimate);
    sum += (viewed.v / viewed.depth).squaredNorm();
  }
  return sum;
}

class FullRivals : public testing::Test {
 protected:
  // Solves by `rival` from the model's start.
  Estimate Solve(KnownRotationSolver* rival) const {
    Estimate estimate = model_.built.start;
    EXPECT_TRUE(rival->Minimize(problem(), /*cancel=*/nullptr, &estimate));
    return estimate;
  }

  double CostOf(const Estimate& estimate) const {
    return Cost(problem(), estimate, Norm::L2(), 1);
  }

  const KnownRotationProblem& problem() const { return model_.built.problem; }

  const BenchmarkModel model_ = SyntheticModel(kSmall, /*seed=*/1);
};

TEST_F(FullRivals, GugatReachesTheCertifiedOptimum) {
  Estimate joint = model_.built.start;
  const JointSummary summary = SolveJoint(problem(), {}, {}, &joint);
  ASSERT_EQ(summary.termination, SolveTermination::kGapReached);
  const double cost = CostOf(Solve(MakeFullGugat().get()));
  EXPECT_GE(cost, summary.lower_bound);
  EXPECT_LE(cost, (1 + 2e-4) * summary.cost_final);
}

TEST_F(FullRivals, ProximalSplittingComesWithinAPercentOfTheOptimum) {
  Estimate joint = model_.built.start;
  const JointSummary summary = SolveJoint(problem(), {}, {}, &joint);
  const double cost = CostOf(Solve(MakeFullProximalSplitting(1).get()));
  EXPECT_GE(cost, summary.lower_bound);
  EXPECT_LE(cost, 1.01 * summary.cost_final);
}

TEST_F(FullRivals, LeastSquaresEndsWhereNoUnknownLowersTheSum) {
  Estimate estimate = Solve(MakeLeastSquares(1).get());
  const double sum = SumOfSquares(problem(), estimate);
  EXPECT_LT(sum, SumOfSquares(problem(), model_.built.start));
  for (size_t k = 0; k < estimate.points.size(); k += 7) {
    for (const double change : {-1e-2, 1e-2}) {
      for (int axis = 0; axis < 3; ++axis) {
        Estimate moved = estimate;
        moved.points[k][axis] += change;
        EXPECT_GT(SumOfSquares(problem(), moved), sum);
      }
    }
  }
  for (size_t f = 0; f < estimate.translations.size(); ++f) {
    Estimate moved = estimate;
    moved.translations[f][0] += 1e-2;
    EXPECT_GT(SumOfSquares(problem(), moved), sum);
  }
}

}  // namespace
}  // namespace krot::internal
