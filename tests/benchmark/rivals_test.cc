#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "krot/analysis/model_comparison.h"
#include "krot/convert/build_problem.h"
#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "krot/synthetic/scene.h"
#include "tests/oracle/ellipsoid_oracle.h"
#include "tests/testing/scene_of.h"
#include "tools/benchmark/competition.h"
#include "tools/benchmark/rivals/bearing_positions.h"
#include "tools/benchmark/rivals/full_rivals.h"
#include "tools/benchmark/rivals/proximal_operator.h"
#include "tools/benchmark/synthetic_model.h"

namespace krot::internal {
namespace {

// What a benchmark compares must solve the same problem: every rival against
// the ellipsoid oracle.

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

// The rivals on the whole problem against a certified bound.

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

using Vectors = std::vector<Eigen::Vector2d>;

double Objective(const Vectors& z, const Vectors& a, double rho) {
  double largest = 0;
  double squares = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    largest = std::max(largest, z[i].norm());
    squares += (z[i] - a[i]).squaredNorm();
  }
  return largest + rho / 2 * squares;
}

Vectors RandomVectors(int count, Random* random) {
  Vectors vectors;
  for (int i = 0; i < count; ++i) {
    vectors.emplace_back(random->Gaussian(), random->Gaussian());
  }
  return vectors;
}

TEST(MaxNormProx, IsALowerPointThanAnyNearby) {
  Random random(/*seed=*/1);
  for (const double rho : {0.1, 1.0, 10.0}) {
    const Vectors a = RandomVectors(6, &random);
    Vectors z = a;
    ApplyMaxNormProx(rho, &z);
    const double lowest = Objective(z, a, rho);
    for (int trial = 0; trial < 200; ++trial) {
      Vectors other = RandomVectors(6, &random);
      for (size_t i = 0; i < other.size(); ++i) {
        other[i] = z[i] + 1e-3 * other[i];
      }
      EXPECT_GE(Objective(other, a, rho), lowest);
    }
  }
}

TEST(MaxNormProx, ShortensByTheReciprocalOfThePenaltyInAll) {
  Vectors z = {{3, 4}, {0, 6}, {1, 0}};  // lengths 5, 6, 1
  ApplyMaxNormProx(/*rho=*/1 / 3.0, &z);
  // 5 and 6 become 4: 1 + 2 = 3.
  EXPECT_NEAR(z[0].norm(), 4, 1e-9);
  EXPECT_NEAR(z[1].norm(), 4, 1e-9);
  EXPECT_NEAR((z[0] - Eigen::Vector2d(2.4, 3.2)).norm(), 0, 1e-9);
  EXPECT_EQ(z[2], Eigen::Vector2d(1, 0));
}

TEST(MaxNormProx, IsZeroWhereThePenaltyIsSmall) {
  Vectors z = {{3, 4}, {0, 6}};
  ApplyMaxNormProx(/*rho=*/1 / 12.0, &z);
  for (const Eigen::Vector2d& vector : z) EXPECT_EQ(vector.norm(), 0);
}

TEST(PositionByBearings, FindsTheCamerasOfASceneWithoutNoise) {
  SceneOptions options = SceneOf(10, 300);
  options.camera_model_id = 1;
  const Model truth = SynthesizeScene(options).ground_truth;
  const BuiltProblem built = BuildProblem(truth, {});
  const Estimate estimate = PositionByBearings(built.problem, {});
  std::vector<PosePair> poses;
  for (const View& view : built.problem.views) {
    const auto centre = [&](const Estimate& x) -> Eigen::Vector3d {
      return -view.cam_from_world_rotation.transpose() *
             view.cam_from_rig_rotation * x.translations[view.frame];
    };
    PosePair pose;
    pose.center1 = centre(built.start);
    pose.center2 = centre(estimate);
    poses.push_back(pose);
  }
  const std::optional<Similarity> fit = AlignCenters(poses);
  ASSERT_TRUE(fit);
  for (const PosePair& pose : poses) {
    EXPECT_LT((*fit * pose.center2 - pose.center1).norm(),
              0.01 * SceneRadius(poses));
  }
}

}  // namespace
}  // namespace krot::internal
