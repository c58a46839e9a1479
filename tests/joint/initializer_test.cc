#include "krot/joint/joint.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "krot/convert/build_problem.h"
#include "krot/problem/cost.h"
#include "krot/synthetic/scene.h"
#include "tests/joint/small_scenes.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

InitializerOptions Options(Norm norm, double max_error) {
  InitializerOptions options;
  options.norm = norm;
  options.max_error = max_error;
  return options;
}

double CostFromTheTruth(const RandomScene& scene, Norm norm) {
  JointOptions options;
  options.norm = norm;
  Estimate estimate = scene.estimate;
  return SolveJoint(scene.problem, options, {}, &estimate).cost_final;
}

// Cost is finite only if all depths are positive.
void ExpectFeasible(const KnownRotationProblem& problem,
                    const InitializerOptions& options, const Estimate& estimate,
                    const InitializerSummary& summary) {
  EXPECT_EQ(summary.termination, SolveTermination::kWithinBound);
  ASSERT_EQ(static_cast<int>(estimate.points.size()), problem.num_points);
  ASSERT_EQ(static_cast<int>(estimate.translations.size()), problem.num_frames);
  EXPECT_LT(Cost(problem, estimate, options.norm, 1), options.max_error);
  EXPECT_FALSE(summary.certificate);
}

void ExpectProvedInfeasible(const KnownRotationProblem& problem,
                            const InitializerOptions& options,
                            const InitializerSummary& summary) {
  EXPECT_EQ(summary.termination, SolveTermination::kInfeasible);
  ASSERT_TRUE(summary.certificate);
  const CertificateCheck check =
      CheckCertificate(problem, options.norm, *summary.certificate);
  EXPECT_TRUE(check.is_accepted) << check.refusal;
  EXPECT_EQ(check.proved_bound, summary.lower_bound);
  EXPECT_GT(check.proved_bound, options.max_error);
}

class FindStartTest : public testing::TestWithParam<double> {
 protected:
  Norm norm() const { return {GetParam()}; }
};

TEST_P(FindStartTest, MeetsTheBoundFromNothing) {
  for (const double baseline : {0.0, 0.3, 0.01}) {
    for (unsigned seed = 1; seed <= 8; ++seed) {
      SCOPED_TRACE(testing::Message() << baseline << ", seed " << seed);
      const RandomScene scene = MakeSmallScene(seed, baseline);
      const InitializerOptions options = Options(norm(), 100);
      Estimate estimate;
      const InitializerSummary summary =
          FindStart(scene.problem, options, {}, &estimate);
      ExpectFeasible(scene.problem, options, estimate, summary);
      EXPECT_FALSE(summary.iterations.empty());
    }
  }
}

TEST_P(FindStartTest, MeetsABoundJustAboveTheOptimum) {
  for (const double baseline : {0.0, 0.3}) {
    for (unsigned seed = 11; seed <= 14; ++seed) {
      SCOPED_TRACE(testing::Message() << baseline << ", seed " << seed);
      const RandomScene scene = MakeSmallScene(seed, baseline);
      const InitializerOptions options =
          Options(norm(), 1.01 * CostFromTheTruth(scene, norm()));
      Estimate estimate;
      const InitializerSummary summary =
          FindStart(scene.problem, options, {}, &estimate);
      ExpectFeasible(scene.problem, options, estimate, summary);
    }
  }
}

TEST_P(FindStartTest, ProvesThatABoundBelowTheOptimumIsUnattainable) {
  for (const double baseline : {0.0, 0.3}) {
    for (unsigned seed = 11; seed <= 14; ++seed) {
      SCOPED_TRACE(testing::Message() << baseline << ", seed " << seed);
      const RandomScene scene = MakeSmallScene(seed, baseline);
      const double optimum = CostFromTheTruth(scene, norm());
      for (const double share : {0.01, 0.5, 0.99}) {
        const InitializerOptions options = Options(norm(), share * optimum);
        Estimate estimate = scene.estimate;
        const InitializerSummary summary =
            FindStart(scene.problem, options, {}, &estimate);
        ExpectProvedInfeasible(scene.problem, options, summary);
        EXPECT_EQ(estimate.points, scene.estimate.points);
        EXPECT_EQ(estimate.translations, scene.estimate.translations);
      }
    }
  }
}

TEST_P(FindStartTest, NamesTheObservationsOfTheComponentThatMissesTheBound) {
  RandomScene good = MakeSmallScene(21);
  const RandomScene bad = MakeSmallScene(22);
  const double bound = 0.9 * CostFromTheTruth(bad, norm());
  for (Observation& o : good.problem.observations) {
    o.E.bottomRows<2>() *= 1e-3;
  }
  const RandomScene glued = Glue(good, bad);
  const InitializerOptions options = Options(norm(), bound);
  Estimate estimate;
  const InitializerSummary summary =
      FindStart(glued.problem, options, {}, &estimate);
  ExpectProvedInfeasible(glued.problem, options, summary);
  EXPECT_GE(summary.certificate->observations.front().observation,
            static_cast<int64_t>(good.problem.observations.size()));
  EXPECT_TRUE(estimate.points.empty());
}

TEST_P(FindStartTest, SolvesSyntheticRigsAndSingleCameras) {
  for (const int sensors_per_rig : {1, 3}) {
    for (const SceneLayout layout :
         {SceneLayout::kOrbit, SceneLayout::kStreet}) {
      SceneOptions scene = SceneOf(12, 150, 4, 0.5);
      scene.layout = layout;
      scene.sensors_per_rig = sensors_per_rig;
      scene.rig_baseline = 0.05;
      const BuiltProblem built =
          BuildProblem(SynthesizeScene(scene).ground_truth, {});
      const InitializerOptions options = Options(norm(), 20);
      Estimate estimate;
      const InitializerSummary summary =
          FindStart(built.problem, options, {}, &estimate);
      ExpectFeasible(built.problem, options, estimate, summary);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Norms, FindStartTest,
    testing::Values(1, 2, std::numeric_limits<double>::infinity()),
    [](const auto& test) {
      return test.param == 1 ? "L1" : test.param == 2 ? "L2" : "LInf";
    });

TEST(FindStart, DoesNotLookAtWhatTheEstimateHolds) {
  RandomScene scene = MakeSmallScene(31);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (Eigen::Vector3d& t : scene.estimate.translations) t.setConstant(nan);
  for (Eigen::Vector3d& s : scene.estimate.points) s.setConstant(nan);
  Estimate from_nothing;
  const InitializerOptions options = Options(Norm::L2(), 100);
  FindStart(scene.problem, options, {}, &from_nothing);
  const InitializerSummary summary =
      FindStart(scene.problem, options, {}, &scene.estimate);
  ExpectFeasible(scene.problem, options, scene.estimate, summary);
  EXPECT_EQ(scene.estimate.points, from_nothing.points);
  EXPECT_EQ(scene.estimate.translations, from_nothing.translations);
}

TEST(FindStart, LeavesWhatNothingSeesAndScalesTheMedianDepthToOne) {
  RandomScene scene = MakeSmallScene(32);
  AddUnseen(&scene);
  FindStart(scene.problem, Options(Norm::L2(), 100), {}, &scene.estimate);
  EXPECT_EQ(scene.estimate.translations.back(), Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(scene.estimate.points.back(), Eigen::Vector3d(-1, -2, -3));
  std::vector<double> depths;
  for (const Observation& o : scene.problem.observations) {
    depths.push_back(ViewPoint(scene.problem, o, scene.estimate).depth);
  }
  std::sort(depths.begin(), depths.end());
  EXPECT_NEAR(depths[depths.size() / 2], 1, 1e-12);
}

TEST(FindStart, ChangesNothingWhenInterrupted) {
  RandomScene scene = MakeSmallScene(33);
  const Estimate before = scene.estimate;
  const CancelFlag is_cancelled = true;
  for (const double max_error : {100.0, 1e-3}) {
    InitializerOptions options = Options(Norm::L2(), max_error);
    const InitializerSummary summary =
        FindStart(scene.problem, options, {1, &is_cancelled}, &scene.estimate);
    EXPECT_EQ(summary.termination, SolveTermination::kInterrupted);
    EXPECT_FALSE(summary.certificate);
    EXPECT_EQ(scene.estimate.points, before.points);
    EXPECT_EQ(scene.estimate.translations, before.translations);
  }
}

TEST(FindStart, ReportsEveryIterationWithTheBoundThatItSeeks) {
  const RandomScene scene = Glue(MakeSmallScene(35), MakeSmallScene(36));
  InitializerOptions options = Options(Norm::L2(), 100);
  int calls = 0;
  options.callback = [&](int iteration, const JointIteration& state) {
    EXPECT_EQ(iteration, ++calls);
    ASSERT_TRUE(state.target);
    EXPECT_LE(*state.target, 100);
    EXPECT_FALSE(state.cost);
    EXPECT_FALSE(state.gap);
  };
  Estimate estimate;
  const InitializerSummary summary =
      FindStart(scene.problem, options, {}, &estimate);
  EXPECT_GT(calls, 2);
  ASSERT_EQ(static_cast<int>(summary.iterations.size()), calls);
  EXPECT_EQ(summary.iterations.front().target, 100);
  EXPECT_LT(summary.iterations.back().target, 100);  // lowered
}

// Set behind the last iteration, when the proof is all that is left to do.
TEST(FindStart, IsInterruptedWhileInfeasibilityIsBeingProved) {
  const RandomScene scene = MakeSmallScene(33);
  Estimate estimate;
  const InitializerSummary proved =
      FindStart(scene.problem, Options(Norm::L2(), 1e-3), {}, &estimate);
  ASSERT_EQ(proved.termination, SolveTermination::kInfeasible);
  CancelFlag is_cancelled = false;
  InitializerOptions options = Options(Norm::L2(), 1e-3);
  options.callback = [&](int iteration, const JointIteration&) {
    is_cancelled = iteration == static_cast<int>(proved.iterations.size());
  };
  const InitializerSummary summary =
      FindStart(scene.problem, options, {1, &is_cancelled}, &estimate);
  EXPECT_EQ(summary.termination, SolveTermination::kInterrupted);
  EXPECT_FALSE(summary.certificate);
}

TEST(FindStart, IsInterruptedAtAnyIteration) {
  const RandomScene scene = MakeSmallScene(33);
  for (const double max_error : {100.0, 1e-3}) {
    Estimate estimate;
    const size_t num_iterations =
        FindStart(scene.problem, Options(Norm::L2(), max_error), {}, &estimate)
            .iterations.size();
    ASSERT_GT(num_iterations, 4u);
    for (size_t last = 1; last < num_iterations; ++last) {
      CancelFlag is_cancelled = false;
      InitializerOptions options = Options(Norm::L2(), max_error);
      options.callback = [&](int iteration, const JointIteration&) {
        if (iteration == static_cast<int>(last)) is_cancelled = true;
      };
      Estimate unwritten;
      const InitializerSummary summary =
          FindStart(scene.problem, options, {1, &is_cancelled}, &unwritten);
      EXPECT_EQ(summary.iterations.size(), last);
      if (summary.certificate) {  // proved just before
        ExpectProvedInfeasible(scene.problem, options, summary);
        continue;
      }
      EXPECT_EQ(summary.termination, SolveTermination::kInterrupted);
      EXPECT_TRUE(unwritten.points.empty());
    }
  }
}

TEST(FindStart, RefusesBadOptions) {
  RandomScene scene = MakeSmallScene(34);
  const auto run = [&](const InitializerOptions& options) {
    FindStart(scene.problem, options, {}, &scene.estimate);
  };
  EXPECT_THROW(run(Options(Norm::L2(), 0)), std::invalid_argument);
  EXPECT_THROW(run(Options({3}, 100)), std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
