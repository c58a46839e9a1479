// What a benchmark compares must solve the same problem: every rival against
// the ellipsoid oracle.

#include <string>
#include <tuple>

#include <gtest/gtest.h>

#include "tests/oracle/ellipsoid_oracle.h"
#include "tools/benchmark/competition.h"

namespace krot::internal {
namespace {

constexpr double kSigma = 5;  // pixels

// The rivals stop when what they know of the optimum is as narrow as
// kRivalTolerance. Proximal splitting knows nothing of it: the growing penalty
// ends it, the sooner the farther off; the benchmark marks where that shows.
double Tolerance(const std::string& name) {
  return name == "proximal" ? 1e-3 : 2 * kRivalTolerance;
}

using RivalsTest = testing::TestWithParam<double>;

TEST_P(RivalsTest, ReachTheOptimumOfTheOracle) {
  const Norm norm{GetParam()};
  Random random(/*seed=*/3);
  const auto rivals = RivalSolvers(norm);
  ASSERT_FALSE(rivals.empty());
  for (const int rays : {2, 3, 5, 10, 20}) {
    for (int instance = 0; instance < 5; ++instance) {
      const auto problem = MakeTriangulation(
          RandomTriangulation(rays, kSigma, &random), &random);
      ASSERT_TRUE(problem);
      const OracleOptimum oracle = MinimizeByEllipsoids(
          problem->residuals, norm, problem->start, /*radius=*/5);
      ASSERT_LT(oracle.cost - oracle.lower_bound, 1e-8);
      for (const auto& rival : rivals) {
        SCOPED_TRACE(rival->Name() + ", " + std::to_string(rays) +
                     " rays, instance " + std::to_string(instance));
        const Eigen::Vector3d x = rival->Minimize(*problem);
        const double cost = problem->Cost(x, norm);
        EXPECT_GE(cost, oracle.lower_bound - 1e-9);
        EXPECT_LE(cost, (1 + Tolerance(rival->Name())) * oracle.cost);
      }
    }
  }
}

TEST_P(RivalsTest, StandAtNoExcessWhereTheyAreTheLowest) {
  const Norm norm{GetParam()};
  Random random(/*seed=*/4);
  std::vector<Subproblem> instances;
  for (int i = 0; i < 3; ++i) {
    const auto problem =
        MakeTriangulation(RandomTriangulation(4, kSigma, &random), &random);
    ASSERT_TRUE(problem);
    instances.push_back(*problem);
  }
  const auto solvers = AllSolvers(norm);
  const std::vector<Standing> standings =
      Compete(instances, norm, solvers, /*repeats=*/1);
  ASSERT_EQ(standings.size(), solvers.size());
  double least = 1;
  for (size_t s = 0; s < standings.size(); ++s) {
    EXPECT_EQ(standings[s].name, solvers[s]->Name());
    EXPECT_GT(standings[s].seconds, 0);
    EXPECT_GE(standings[s].max_excess, standings[s].mean_excess);
    least = std::min(least, standings[s].mean_excess);
  }
  // No solver is above the lowest of all everywhere by more than rounding.
  EXPECT_LT(least, 1e-9);
}

std::string NameOf(const testing::TestParamInfo<double>& info) {
  return info.param == 2 ? "L2" : "LInf";
}

INSTANTIATE_TEST_SUITE_P(Norms, RivalsTest, testing::Values(2, Norm::LInf().p),
                         NameOf);

}  // namespace
}  // namespace krot::internal
