// Sub-problem optima against the ellipsoid oracle.

#include <algorithm>
#include <string>
#include <tuple>

#include <gtest/gtest.h>

#include "krot/minimax/fast_descent.h"
#include "tests/oracle/ellipsoid_oracle.h"
#include "tests/testing/random_residuals.h"

namespace krot::internal {
namespace {

constexpr double kAgreement = 1e-9;  // pixels

enum class Kind { kTriangulation, kResection };

struct Amount {
  int rays;
  int instances;
};
// 884 problems for every norm and kind, each solved from two starts.
constexpr Amount kAmounts[] = {{2, 200}, {3, 200}, {4, 160}, {5, 120}, {8, 100},
                               {13, 60}, {30, 30}, {100, 8}, {200, 6}};

using OptimumTest = testing::TestWithParam<std::tuple<double, Kind>>;

ResidualProblem MakeProblem(Kind kind, int rays, ProblemGenerator* generator) {
  const double noise_px = 5;
  return kind == Kind::kTriangulation ? generator->Triangulation(rays, noise_px)
                                      : generator->Resection(rays, noise_px);
}

TEST_P(OptimumTest, AgreesWithTheOracleFromGoodAndBadStarts) {
  const auto [p, kind] = GetParam();
  const Norm norm{p};
  FastDescent descent(FastDescentOptions{}, norm);
  ProblemGenerator generator(/*seed=*/7);
  for (const Amount& amount : kAmounts) {
    for (int instance = 0; instance < amount.instances; ++instance) {
      SCOPED_TRACE(std::to_string(amount.rays) + " rays, instance " +
                   std::to_string(instance));
      const ResidualProblem problem =
          MakeProblem(kind, amount.rays, &generator);
      Fill(problem, &descent.residuals());
      Eigen::Vector3d x = generator.Start(problem, 0.02);
      const DescentSummary good = descent.Minimize(&x);
      const OracleOptimum oracle =
          MinimizeByEllipsoids(problem.residuals, norm, x, /*radius=*/20);
      ASSERT_LT(oracle.cost - oracle.lower_bound, 0.5 * kAgreement);

      EXPECT_NEAR(good.cost, oracle.cost, kAgreement);
      EXPECT_NEAR(problem.Cost(x, norm), good.cost, 1e-11 * good.cost);

      Eigen::Vector3d y = generator.Start(problem, 1.5);
      const DescentSummary bad = descent.Minimize(&y);
      EXPECT_NEAR(bad.cost, oracle.cost, kAgreement);
      for (const DescentSummary& summary : {good, bad}) {
        EXPECT_EQ(summary.termination, DescentTermination::kStationary);
        EXPECT_LE(summary.cost, summary.cost_initial);
      }
    }
  }
}

// Where no direction lowers all residuals that are active, within 1 % of the
// largest, one of these is at least as large wherever one goes: the optimum is
// above 0.99 of the cost. So it is where the step's tolerance ends the descent.
TEST_P(OptimumTest, IsMissedByLessThanTheTolerancesOfThePapersSettings) {
  const auto [p, kind] = GetParam();
  const Norm norm{p};
  FastDescentOptions options;
  options.settings = FastDescentSettings::kPaper;
  FastDescent descent(options, norm);
  ProblemGenerator generator(/*seed=*/8);
  for (const int rays : {2, 3, 5, 8, 20}) {
    for (int instance = 0; instance < 20; ++instance) {
      const ResidualProblem problem = MakeProblem(kind, rays, &generator);
      Fill(problem, &descent.residuals());
      Eigen::Vector3d x = generator.Start(problem, 0.3);
      const double start = problem.Cost(x, norm);
      const DescentSummary summary = descent.Minimize(&x);
      const OracleOptimum oracle =
          MinimizeByEllipsoids(problem.residuals, norm, x, /*radius=*/20);
      EXPECT_NEAR(summary.cost_initial, start, 1e-11 * start);
      EXPECT_NEAR(problem.Cost(x, norm), summary.cost, 1e-11 * start);
      EXPECT_LE(summary.cost, summary.cost_initial);
      EXPECT_GE(summary.cost, oracle.lower_bound - kAgreement);
      EXPECT_LE(summary.iterations, options.max_iterations);
      if (summary.termination == DescentTermination::kMaxIterations) {
        EXPECT_EQ(summary.iterations, options.max_iterations);
        EXPECT_LE(summary.cost, 1.1 * oracle.cost);
        continue;
      }
      EXPECT_TRUE(summary.termination == DescentTermination::kStationary ||
                  summary.termination == DescentTermination::kNoDecrease);
      EXPECT_LE((1 - options.active_tolerance) * summary.cost,
                oracle.cost + kAgreement);
    }
  }
}

std::string NameOf(const testing::TestParamInfo<OptimumTest::ParamType>& info) {
  const auto [p, kind] = info.param;
  std::string norm = std::isinf(p) ? "Inf" : std::to_string(p).substr(0, 3);
  std::replace(norm.begin(), norm.end(), '.', '_');
  return (kind == Kind::kTriangulation ? "TriangulationL" : "ResectionL") +
         norm;
}

INSTANTIATE_TEST_SUITE_P(
    , OptimumTest,
    testing::Combine(testing::Values(1, 1.5, 2, 3, Norm::LInf().p),
                     testing::Values(Kind::kTriangulation, Kind::kResection)),
    NameOf);

}  // namespace
}  // namespace krot::internal
