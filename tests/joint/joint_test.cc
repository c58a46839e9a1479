#include "krot/joint/joint.h"

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "krot/convert/build_problem.h"
#include "krot/problem/cost.h"
#include "krot/sweeps/res_int.h"
#include "krot/synthetic/scene.h"
#include "tests/joint/small_scenes.h"
#include "tests/oracle/lp_oracle.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

constexpr double kGap = 1e-6;

JointOptions Options(Norm norm) {
  JointOptions options;
  options.norm = norm;
  options.relative_gap = kGap;
  return options;
}

// Recomputes everything that the summary claims.
void ExpectCertified(const KnownRotationProblem& problem, Norm norm,
                     const Estimate& estimate, const JointSummary& summary) {
  EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
  EXPECT_EQ(summary.cost_final, Cost(problem, estimate, norm, 1));
  EXPECT_LE(summary.cost_final, summary.cost_initial);
  ASSERT_TRUE(summary.certificate);
  const CertificateCheck check =
      CheckCertificate(problem, norm, *summary.certificate);
  EXPECT_TRUE(check.is_accepted) << check.refusal;
  EXPECT_EQ(check.proved_bound, summary.lower_bound);
  EXPECT_LE(check.proved_bound, summary.cost_final);
  EXPECT_GE(check.proved_bound, (1 - kGap) * summary.cost_final);
}

double OptimalCost(const RandomScene& scene, Norm norm) {
  Estimate estimate = scene.estimate;
  return SolveJoint(scene.problem, Options(norm), {}, &estimate).cost_final;
}

// Every unknown moved by up to `size` along each axis; depths stay positive.
Estimate Shake(const RandomScene& scene, double size) {
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (;; size *= 0.9) {
    Estimate estimate = scene.estimate;
    for (auto* vectors : {&estimate.translations, &estimate.points}) {
      for (Eigen::Vector3d& vector : *vectors) {
        for (double& entry : vector) entry += size * uniform(generator);
      }
    }
    if (std::isfinite(Cost(scene.problem, estimate, Norm::L2(), 1))) {
      return estimate;
    }
  }
}

// Sweeps after a rough start push points against their cones.
Estimate HugTheBoundary(const RandomScene& scene, Norm norm) {
  Estimate estimate = Shake(scene, 3);
  ResIntOptions sweeps;
  sweeps.norm = norm;
  sweeps.max_sweeps = 5;
  sweeps.sweep_tolerance = 1e-9;
  SolveResInt(scene.problem, sweeps, {}, &estimate);
  return estimate;
}

class SolveJointTest : public testing::TestWithParam<double> {
 protected:
  Norm norm() const { return {GetParam()}; }
};

TEST_P(SolveJointTest, ProvesItsOptimumToAMillionth) {
  for (const double baseline : {0.0, 0.3, 0.05}) {
    for (unsigned seed = 1; seed <= 8; ++seed) {
      SCOPED_TRACE(testing::Message() << baseline << ", seed " << seed);
      RandomScene scene = MakeSmallScene(seed, baseline);
      const JointSummary summary =
          SolveJoint(scene.problem, Options(norm()), {}, &scene.estimate);
      ExpectCertified(scene.problem, norm(), scene.estimate, summary);
    }
  }
}

using SolvePolyhedralJointTest = SolveJointTest;

TEST_P(SolvePolyhedralJointTest, AgreesWithLinearProgrammes) {
  for (const double baseline : {0.0, 0.3}) {
    for (unsigned seed = 11; seed <= 13; ++seed) {
      SCOPED_TRACE(testing::Message() << baseline << ", seed " << seed);
      RandomScene scene = MakeSmallScene(seed, baseline);
      // The larger the depths, the less CLP's absolute tolerance matters.
      const std::optional<double> expected = OptimalCostByBisection(
          scene.problem, norm(), Cost(scene.problem, scene.estimate, norm(), 1),
          baseline > 0 ? 0.1 : 1000);
      if (!expected) GTEST_SKIP() << "built without CLP";
      const double cost = OptimalCost(scene, norm());
      EXPECT_NEAR(cost, *expected, 1e-6 * cost);
    }
  }
}

TEST_P(SolveJointTest, EndsAtTheSameOptimumFromAnyStart) {
  for (const double baseline : {0.0, 0.3}) {
    for (unsigned seed = 21; seed <= 24; ++seed) {
      SCOPED_TRACE(testing::Message() << baseline << ", seed " << seed);
      const RandomScene scene = MakeSmallScene(seed, baseline);
      const double optimum = OptimalCost(scene, norm());

      Estimate far = Shake(scene, 2);
      JointSummary summary =
          SolveJoint(scene.problem, Options(norm()), {}, &far);
      EXPECT_GT(summary.cost_initial, 20 * optimum);
      ExpectCertified(scene.problem, norm(), far, summary);
      EXPECT_NEAR(summary.cost_final, optimum, 1e-6 * optimum);

      Estimate from_nothing;
      InitializerOptions initializer;
      initializer.norm = norm();
      FindStart(scene.problem, initializer, {}, &from_nothing);
      summary = SolveJoint(scene.problem, Options(norm()), {}, &from_nothing);
      ExpectCertified(scene.problem, norm(), from_nothing, summary);
      EXPECT_NEAR(summary.cost_final, optimum, 1e-6 * optimum);
    }
  }
}

TEST_P(SolveJointTest, LeavesStartsThatHugTheBoundary) {
  for (unsigned seed = 31; seed <= 36; ++seed) {
    SCOPED_TRACE(seed);
    const RandomScene scene = MakeSmallScene(seed);
    Estimate estimate = HugTheBoundary(scene, norm());
    const JointSummary summary =
        SolveJoint(scene.problem, Options(norm()), {}, &estimate);
    ExpectCertified(scene.problem, norm(), estimate, summary);
    const double optimum = OptimalCost(scene, norm());
    EXPECT_NEAR(summary.cost_final, optimum, 1e-6 * optimum);
  }
}

TEST_P(SolveJointTest, SolvesEveryComponentToItsOwnOptimum) {
  const RandomScene first = MakeSmallScene(41);
  const RandomScene second = MakeSmallScene(42, 0.3);
  for (const bool is_first_first : {true, false}) {
    RandomScene glued =
        is_first_first ? Glue(first, second) : Glue(second, first);
    const JointSummary summary =
        SolveJoint(glued.problem, Options(norm()), {}, &glued.estimate);
    ExpectCertified(glued.problem, norm(), glued.estimate, summary);

    const RandomScene& front = is_first_first ? first : second;
    double cost_of_front = 0;
    double cost_of_back = 0;
    for (const Observation& o : glued.problem.observations) {
      double& cost =
          o.point < front.problem.num_points ? cost_of_front : cost_of_back;
      cost = std::max(
          cost,
          ResidualOf(ViewPoint(glued.problem, o, glued.estimate), norm()));
    }
    if (!is_first_first) std::swap(cost_of_front, cost_of_back);
    const double optimum_of_first = OptimalCost(first, norm());
    const double optimum_of_second = OptimalCost(second, norm());
    EXPECT_NEAR(cost_of_front, optimum_of_first, 1e-6 * optimum_of_first);
    EXPECT_NEAR(cost_of_back, optimum_of_second, 1e-6 * optimum_of_second);
  }
}

TEST_P(SolveJointTest, LeavesWhatNothingSeesWhereItIs) {
  RandomScene scene = MakeSmallScene(43);
  const double optimum = OptimalCost(scene, norm());
  AddUnseen(&scene);
  const JointSummary summary =
      SolveJoint(scene.problem, Options(norm()), {}, &scene.estimate);
  ExpectCertified(scene.problem, norm(), scene.estimate, summary);
  EXPECT_EQ(summary.cost_final, optimum);
  EXPECT_EQ(scene.estimate.translations.back(), Eigen::Vector3d(7, 8, 9));
  EXPECT_EQ(scene.estimate.points.back(), Eigen::Vector3d(-1, -2, -3));
}

TEST_P(SolveJointTest, IsThereSoonerFromMultipliersOfAnEarlierSolve) {
  const RandomScene scene = MakeSmallScene(54);
  KnownMultipliers known;
  const auto solve = [&] {
    Estimate estimate = scene.estimate;
    const JointSummary summary =
        SolveJoint(scene.problem, Options(norm()), {}, &estimate, &known);
    ExpectCertified(scene.problem, norm(), estimate, summary);
    return summary;
  };
  const JointSummary cold = solve();
  const JointSummary warm = solve();
  EXPECT_LT(warm.iterations.size(), cold.iterations.size());
}

std::string NameOf(const testing::TestParamInfo<double>& test) {
  return test.param == 1 ? "L1" : test.param == 2 ? "L2" : "LInf";
}

INSTANTIATE_TEST_SUITE_P(
    Norms, SolveJointTest,
    testing::Values(1, 2, std::numeric_limits<double>::infinity()), NameOf);
INSTANTIATE_TEST_SUITE_P(
    Norms, SolvePolyhedralJointTest,
    testing::Values(1, std::numeric_limits<double>::infinity()), NameOf);

TEST(SolveJoint, ReportsEveryIterationAndNeverALossOfWhatItHad) {
  RandomScene scene = Glue(MakeSmallScene(51), MakeSmallScene(52));
  JointOptions options = Options(Norm::L2());
  int calls = 0;
  options.callback = [&](int iteration, const JointIteration&) {
    EXPECT_EQ(iteration, ++calls);
  };
  const JointSummary summary =
      SolveJoint(scene.problem, options, {}, &scene.estimate);
  ASSERT_EQ(static_cast<int>(summary.iterations.size()), calls);
  double seconds = 0;
  double bound = 0;
  for (const JointIteration& iteration : summary.iterations) {
    EXPECT_LE(iteration.cost, summary.cost_initial);
    EXPECT_GE(iteration.seconds, seconds);
    EXPECT_GE(iteration.lower_bound.value_or(0), bound);
    seconds = iteration.seconds;
    bound = iteration.lower_bound.value_or(0);
  }
  EXPECT_EQ(bound, summary.lower_bound);
  // Moved along its gauge since: equal but for what that rounds.
  EXPECT_NEAR(*summary.iterations.back().cost, summary.cost_final,
              1e-13 * summary.cost_final);
}

TEST(SolveJoint, StopsAtMaxIterations) {
  RandomScene scene = MakeSmallScene(53);
  JointOptions options = Options(Norm::L2());
  options.max_iterations = 1;
  const JointSummary summary =
      SolveJoint(scene.problem, options, {}, &scene.estimate);
  EXPECT_EQ(summary.termination, SolveTermination::kMaxIterations);
  EXPECT_EQ(summary.iterations.size(), 1u);
  EXPECT_LE(summary.cost_final, summary.cost_initial);
  EXPECT_EQ(summary.cost_final,
            Cost(scene.problem, scene.estimate, Norm::L2(), 1));
}

TEST(SolveJoint, KeepsWhatItHasWhenInterrupted) {
  const RandomScene scene = MakeSmallScene(54);
  for (const int last : {0, 1, 4}) {
    CancelFlag is_cancelled = last == 0;
    JointOptions options = Options(Norm::L2());
    const Context context{1, &is_cancelled};
    options.callback = [&](int iteration, const JointIteration&) {
      if (iteration == last) is_cancelled = true;
    };
    Estimate estimate = scene.estimate;
    const JointSummary summary =
        SolveJoint(scene.problem, options, context, &estimate);
    EXPECT_EQ(summary.termination, SolveTermination::kInterrupted);
    EXPECT_EQ(static_cast<int>(summary.iterations.size()), last);
    EXPECT_LE(summary.cost_final, summary.cost_initial);
    EXPECT_EQ(summary.cost_final, Cost(scene.problem, estimate, Norm::L2(), 1));
  }
}

// Sixteen on average; five starts in a hundred take more than sixty.
TEST(SolveJoint, IsThereSoonFromStartsThatHugTheBoundary) {
  size_t num_iterations = 0;
  for (unsigned seed = 1; seed <= 100; ++seed) {
    SCOPED_TRACE(seed);
    const RandomScene scene = MakeSmallScene(seed);
    JointOptions options;
    options.relative_gap = 1e-4;
    Estimate estimate = HugTheBoundary(scene, options.norm);
    const JointSummary summary =
        SolveJoint(scene.problem, options, {}, &estimate);
    EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
    EXPECT_LE(summary.iterations.size(), 100u);
    num_iterations += summary.iterations.size();
  }
  EXPECT_LE(num_iterations, 1600u);
}

// With starts from most of which the interior point gets nowhere.
TEST(SolveJoint, ReportsAFreshStartAndItsInterruption) {
  int num_interrupted = 0;
  for (const unsigned seed : {35, 47, 61, 80}) {
    SCOPED_TRACE(seed);
    const RandomScene scene = MakeSmallScene(seed);
    Estimate estimate = HugTheBoundary(scene, Norm::L2());
    CancelFlag is_cancelled = false;
    JointOptions options = Options(Norm::L2());
    const Context context{1, &is_cancelled};
    options.callback = [&](int, const JointIteration& state) {
      if (!state.target) return;
      EXPECT_LT(*state.target, *state.cost);
      EXPECT_FALSE(state.gap);
      is_cancelled = true;
      ++num_interrupted;
    };
    const JointSummary summary =
        SolveJoint(scene.problem, options, context, &estimate);
    EXPECT_EQ(summary.termination == SolveTermination::kInterrupted,
              is_cancelled);
    EXPECT_EQ(summary.iterations.back().target.has_value(), is_cancelled);
    EXPECT_LE(summary.cost_final, summary.cost_initial);
    EXPECT_EQ(summary.cost_final, Cost(scene.problem, estimate, Norm::L2(), 1));
  }
  EXPECT_GT(num_interrupted, 0);
}

TEST(SolveJoint, OfNothingIsDone) {
  KnownRotationProblem problem;
  IndexObservations(&problem);
  Estimate estimate;
  const JointSummary summary =
      SolveJoint(problem, Options(Norm::L2()), {}, &estimate);
  EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
  EXPECT_EQ(summary.cost_final, 0);
}

TEST(SolveJoint, RefusesStartsBehindACameraAndBadOptions) {
  RandomScene scene = MakeSmallScene(55);
  const auto run = [&](const JointOptions& options) {
    SolveJoint(scene.problem, options, {}, &scene.estimate);
  };
  EXPECT_THROW(run(Options({1.5})), std::invalid_argument);
  JointOptions options = Options(Norm::L2());
  options.relative_gap = 0;
  EXPECT_THROW(run(options), std::invalid_argument);
  options = Options(Norm::L2());
  options.max_iterations = 0;
  EXPECT_THROW(run(options), std::invalid_argument);
  scene.estimate.points[0] *= -1;
  EXPECT_THROW(run(Options(Norm::L2())), std::invalid_argument);
}

// Outliers of hundreds of pixels: points slide into cameras on the way down,
// the interior point stalls above the optimum, and few observations decide.
TEST(SolveJoint, ProvesTheOptimumOfModelsWithGrossOutliers) {
  for (const SceneLayout layout : {SceneLayout::kOrbit, SceneLayout::kStreet}) {
    for (const unsigned seed : {1u, 2u, 3u}) {
      SCOPED_TRACE(testing::Message()
                   << static_cast<int>(layout) << ", seed " << seed);
      SceneOptions scene = SceneOf(8, 200, 4, 0.5, seed);
      scene.layout = layout;
      scene.outlier_ratio = 0.02;
      const BuiltProblem built = BuildProblem(SynthesizeScene(scene).model, {});
      JointOptions options;
      options.relative_gap = 1e-4;
      Estimate estimate = built.start;
      const JointSummary summary =
          SolveJoint(built.problem, options, {}, &estimate);
      EXPECT_GT(summary.cost_final, 10);
      ASSERT_TRUE(summary.certificate);
      const CertificateCheck check =
          CheckCertificate(built.problem, options.norm, *summary.certificate);
      EXPECT_TRUE(check.is_accepted) << check.refusal;
      const double cost = Cost(built.problem, estimate, options.norm, 1);
      EXPECT_LE(check.proved_bound, cost);
      EXPECT_GE(check.proved_bound, (1 - options.relative_gap) * cost);
    }
  }
}

}  // namespace
}  // namespace krot::internal
