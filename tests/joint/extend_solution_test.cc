#include <algorithm>

#include <gtest/gtest.h>

#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "krot/problem/subset.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

constexpr double kRoom = 1 + 1e-3;

// A working set solved for itself: `estimate` is its optimum, the points
// outside stand where the scene has them.
struct Solved {
  explicit Solved(unsigned seed, int num_points, int ties)
      : scene(MakeScene(seed, num_points)),
        set(scene.problem),
        estimate(scene.estimate) {
    set.AddTies(ties);
    const ProblemSubset part(scene.problem, set.Observations());
    Estimate optimum = part.Restrict(estimate);
    SolveJoint(part.problem(), {}, {}, &optimum);
    part.Replace(optimum, &estimate);
    level = set.Cost(estimate, Norm::L2());
  }

  static RandomScene MakeScene(unsigned seed, int num_points) {
    RandomSceneOptions options;
    options.num_points = num_points;
    options.seed = seed;
    return MakeRandomScene(options);
  }
  double CostOf(const Estimate& e) const {
    return Cost(scene.problem, e, Norm::L2(), 1);
  }
  bool Extend(double highest, Estimate* extended) const {
    *extended = estimate;
    return ExtendSolution(scene.problem, Norm::L2(), {}, level, highest,
                          extended);
  }

  RandomScene scene;
  WorkingSet set;
  Estimate estimate;
  double level = 0;
};

TEST(ExtendSolution, SucceedsExactlyIfNoResidualIsAboveTheHighest) {
  int num_extended = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const Solved solved(seed, 30, 20);
    Estimate extended;
    // Between a little more and much more than the set's own cost.
    const double highest = (1 + 0.02 * (seed % 10)) * kRoom * solved.level;
    const bool does_fit = solved.Extend(highest, &extended);
    EXPECT_EQ(does_fit, solved.CostOf(extended) <= highest);
    EXPECT_LE(solved.CostOf(extended), solved.CostOf(solved.estimate));
    num_extended += does_fit;
  }
  // Both happen.
  EXPECT_GT(num_extended, 5);
  EXPECT_LT(num_extended, 35);
}

// Where the optimum of all is above, by the joint solver's own proof.
TEST(ExtendSolution, FailsWhereNoEstimateIsBelow) {
  int num_impossible = 0;
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const Solved solved(seed, 60, 5);
    Estimate optimum = solved.scene.estimate;
    const JointSummary all = SolveJoint(solved.scene.problem, {}, {}, &optimum);
    ASSERT_EQ(all.termination, SolveTermination::kGapReached);
    if (all.lower_bound <= kRoom * solved.level) continue;
    ++num_impossible;
    Estimate extended;
    EXPECT_FALSE(solved.Extend(kRoom * solved.level, &extended));
  }
  EXPECT_GT(num_impossible, 5);
}

TEST(ExtendSolution, LeavesAloneWhatFits) {
  const Solved solved(1, 40, 15);
  const double cost = solved.CostOf(solved.estimate);
  Estimate extended = solved.estimate;
  EXPECT_TRUE(ExtendSolution(solved.scene.problem, Norm::L2(), {}, cost, cost,
                             &extended));
  EXPECT_EQ(extended.points, solved.estimate.points);
  EXPECT_EQ(extended.translations, solved.estimate.translations);
}

TEST(ExtendSolution, BringsPointsFromBehindACameraWhereRaysMeet) {
  Solved solved(1, 40, 15);
  int32_t outside = 0;
  while (solved.set.Contains(outside)) ++outside;
  solved.estimate.points[outside] *= -1;
  Estimate extended;
  EXPECT_TRUE(solved.Extend(1e6, &extended));
  EXPECT_LE(solved.CostOf(extended), 1e6);
}

TEST(ExtendSolution, LeavesPointsThatNoPlacePutsInFrontAndFails) {
  Solved solved(1, 40, 15);
  int32_t outside = 0;
  while (solved.set.Contains(outside)) ++outside;
  KnownRotationProblem& problem = solved.scene.problem;
  problem.observations[problem.point_begin[outside]].E *= -1;
  Estimate extended;
  EXPECT_FALSE(solved.Extend(1e6, &extended));
  EXPECT_EQ(extended.points[outside], solved.estimate.points[outside]);
}

}  // namespace
}  // namespace krot::internal
