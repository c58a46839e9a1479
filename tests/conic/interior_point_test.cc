#include "krot/conic/interior_point.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gtest/gtest.h>

#include "krot/minimax/residual_set.h"
#include "krot/problem/cost.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

RandomScene MakeScene(unsigned seed, int num_points, double baseline = 0) {
  RandomSceneOptions options;
  options.num_points = num_points;
  options.views_per_frame = baseline > 0 ? 2 : 1;
  options.baseline = baseline;
  options.seed = seed;
  return MakeRandomScene(options);
}

InteriorPointOptions Options(Norm norm) {
  InteriorPointOptions options;
  options.norm = norm;
  return options;
}

class InteriorPoint : public testing::TestWithParam<double> {
 protected:
  Norm norm() const { return {GetParam()}; }
};

TEST_P(InteriorPoint, StaysInsideAndEndsNoWorseThanItBegan) {
  for (const double baseline : {0.0, 0.3}) {
    for (unsigned seed = 1; seed <= 4; ++seed) {
      SCOPED_TRACE(seed);
      RandomScene scene = MakeScene(seed, 30, baseline);
      const double start = Cost(scene.problem, scene.estimate, norm(), 1);
      double least = start;
      int calls = 0;
      InteriorPointOptions options = Options(norm());
      options.stop = [&](const ConicIterate& iterate) {
        EXPECT_EQ(iterate.iteration, ++calls);
        const double cost =  // infinite unless all depths are positive
            Cost(scene.problem, *iterate.estimate, norm(), 1);
        EXPECT_EQ(iterate.cost, cost);
        EXPECT_LE(cost, iterate.gamma);
        EXPECT_GT(iterate.gap, 0);
        EXPECT_GT(iterate.step, 0);
        EXPECT_LE(iterate.step, 1);
        least = std::min(least, cost);
        for (const Multiplier& multiplier : *iterate.multipliers) {
          EXPECT_LE(DualNorm(multiplier.y, norm()),
                    multiplier.lambda * (1 + 1e-12));
        }
        return false;
      };
      std::vector<Multiplier> multipliers;
      const InteriorPointSummary summary = MinimizeJointly(
          scene.problem, options, {}, &scene.estimate, &multipliers);
      EXPECT_EQ(summary.iterations, calls);
      EXPECT_LT(summary.gap, 1e-8);
      EXPECT_EQ(Cost(scene.problem, scene.estimate, norm(), 1), least);
      EXPECT_LT(least, 0.9 * start);
    }
  }
}

// Sum_i A_i'y_i + gamma lambda_i c_i = 0, per point and per frame.
TEST_P(InteriorPoint, MultipliersAreStationaryAtTheEnd) {
  RandomScene scene = MakeScene(5, 30);
  InteriorPointOptions options = Options(norm());
  options.smallest_gap = 1e-8;
  std::vector<Multiplier> multipliers;
  const InteriorPointSummary summary = MinimizeJointly(
      scene.problem, options, {}, &scene.estimate, &multipliers);
  std::vector<Eigen::Vector3d> of_point(scene.problem.num_points,
                                        Eigen::Vector3d::Zero());
  std::vector<Eigen::Vector3d> of_frame(scene.problem.num_frames,
                                        Eigen::Vector3d::Zero());
  double size = 0;
  for (size_t i = 0; i < multipliers.size(); ++i) {
    const Observation& o = scene.problem.observations[i];
    const View& view = scene.problem.views[o.view];
    Eigen::Vector3d force;
    force << summary.gamma * multipliers[i].lambda, multipliers[i].y;
    const Eigen::Vector3d cam = o.E.transpose() * force;  // the camera's axes
    of_point[o.point] += view.cam_from_world_rotation.transpose() * cam;
    of_frame[view.frame] += view.cam_from_rig_rotation.transpose() * cam;
    size += (o.E.bottomRows<2>().transpose() * multipliers[i].y).norm();
  }
  for (const Eigen::Vector3d& sum : of_point) {
    EXPECT_LT(sum.norm(), 1e-6 * size);
  }
  for (const Eigen::Vector3d& sum : of_frame) {
    EXPECT_LT(sum.norm(), 1e-6 * size);
  }
}

// As where a working set grows: from the multipliers of the observations near
// the maximum, all others still unknown.
TEST_P(InteriorPoint, IsThereSoonerFromKnownMultipliers) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    const RandomScene scene = MakeScene(seed, 60);
    const KnownRotationProblem& problem = scene.problem;
    InteriorPointOptions options = Options(norm());
    options.smallest_gap = 1e-5;
    options.max_iterations = 6;
    Estimate start = scene.estimate;
    std::vector<Multiplier> known;
    MinimizeJointly(problem, options, {}, &start, &known);
    options.max_iterations = 200;
    Estimate cold = start;
    std::vector<Multiplier> multipliers;
    const InteriorPointSummary from_nothing =
        MinimizeJointly(problem, options, {}, &cold, &multipliers);
    const double level = 0.5 * Cost(problem, start, norm(), 1);
    for (size_t i = 0; i < known.size(); ++i) {
      const double residual = ResidualOf(
          ViewPoint(problem, problem.observations[i], start), norm());
      if (residual < level) known[i] = {};
    }
    options.known_multipliers = &known;
    Estimate warm = start;
    const InteriorPointSummary from_known =
        MinimizeJointly(problem, options, {}, &warm, &multipliers);
    EXPECT_LT(from_known.iterations, from_nothing.iterations);
    const double cost = Cost(problem, cold, norm(), 1);
    EXPECT_NEAR(Cost(problem, warm, norm(), 1), cost, 1e-4 * cost);
  }
}

TEST_P(InteriorPoint, DoesNotMoveTheScaleOrTheFrameThatSeesMost) {
  // All frames see as much: the first one is held.
  RandomScene scene = MakeScene(7, 30);
  const Estimate start = scene.estimate;
  std::vector<Multiplier> multipliers;
  MinimizeJointly(scene.problem, Options(norm()), {}, &scene.estimate,
                  &multipliers);
  EXPECT_EQ(scene.estimate.translations[0], start.translations[0]);
  double log_growth = 0;
  for (const Observation& o : scene.problem.observations) {
    log_growth += std::log(ViewPoint(scene.problem, o, scene.estimate).depth /
                           ViewPoint(scene.problem, o, start).depth);
  }
  log_growth /= static_cast<double>(scene.problem.observations.size());
  EXPECT_NEAR(log_growth, 0, 0.05);
}

// However far away some of it is: else nothing holds it near the rest.
TEST_P(InteriorPoint, KeepsTheMeanDepthOfAScene) {
  RandomScene scene = MakeScene(7, 30);
  const auto mean_depth = [&](const Estimate& estimate) {
    double sum = 0;
    for (const Observation& o : scene.problem.observations) {
      sum += ViewPoint(scene.problem, o, estimate).depth;
    }
    return sum / static_cast<double>(scene.problem.observations.size());
  };
  const Eigen::Vector3d centre =
      -scene.problem.views[0].cam_from_world_rotation.transpose() *
      scene.estimate.translations[0];
  Eigen::Vector3d& far = scene.estimate.points[0];
  far = centre + 100 * (far - centre);
  ASSERT_TRUE(std::isfinite(Cost(scene.problem, scene.estimate, norm(), 1)));
  const double before = mean_depth(scene.estimate);
  InteriorPointOptions options = Options(norm());
  options.stop = [&](const ConicIterate& iterate) {
    EXPECT_NEAR(mean_depth(*iterate.estimate), before, 1e-9 * before);
    return false;
  };
  std::vector<Multiplier> multipliers;
  MinimizeJointly(scene.problem, options, {}, &scene.estimate, &multipliers);
}

TEST_P(InteriorPoint, TellsWhyItEnded) {
  const RandomScene scene = MakeScene(8, 30);
  const auto run = [&](const InteriorPointOptions& options,
                       const Context& context = {}) {
    Estimate estimate = scene.estimate;
    std::vector<Multiplier> multipliers;
    const InteriorPointSummary summary = MinimizeJointly(
        scene.problem, options, context, &estimate, &multipliers);
    EXPECT_LE(Cost(scene.problem, estimate, norm(), 1),
              Cost(scene.problem, scene.estimate, norm(), 1));
    return summary;
  };
  InteriorPointOptions options = Options(norm());
  options.smallest_gap = 1e-5;
  InteriorPointSummary summary = run(options);
  EXPECT_EQ(summary.termination, InteriorPointTermination::kConverged);
  EXPECT_LE(summary.gap, 1e-5);

  options.max_iterations = 2;
  summary = run(options);
  EXPECT_EQ(summary.termination, InteriorPointTermination::kMaxIterations);
  EXPECT_EQ(summary.iterations, 2);

  options.stop = [](const ConicIterate&) { return true; };
  summary = run(options);
  EXPECT_EQ(summary.termination, InteriorPointTermination::kStopped);
  EXPECT_EQ(summary.iterations, 1);

  const CancelFlag cancelled = true;
  summary = run(options, {1, &cancelled});
  EXPECT_EQ(summary.termination, InteriorPointTermination::kInterrupted);
  EXPECT_EQ(summary.iterations, 0);
}

TEST_P(InteriorPoint, FindsAnEstimateBelowAnAttainableBoundFromNothing) {
  for (const double baseline : {0.0, 0.3}) {
    const RandomScene scene = MakeScene(9, 30, baseline);
    const double bound = 0.9 * Cost(scene.problem, scene.estimate, norm(), 1);
    Estimate estimate;
    std::vector<Multiplier> multipliers;
    const InteriorPointSummary summary =
        FindFeasible(scene.problem, Options(norm()), {}, bound, 1e-2, &estimate,
                     &multipliers);
    EXPECT_EQ(summary.termination, InteriorPointTermination::kFeasible);
    EXPECT_LT(Cost(scene.problem, estimate, norm(), 1), bound);
  }
}

TEST_P(InteriorPoint, LeavesTheEstimateAloneWhereTheBoundIsUnattainable) {
  RandomScene scene = MakeScene(10, 30);
  Estimate optimum = scene.estimate;
  std::vector<Multiplier> multipliers;
  MinimizeJointly(scene.problem, Options(norm()), {}, &optimum, &multipliers);
  const double bound = 0.9 * Cost(scene.problem, optimum, norm(), 1);
  const Estimate before = scene.estimate;
  const InteriorPointSummary summary =
      FindFeasible(scene.problem, Options(norm()), {}, bound, 1,
                   &scene.estimate, &multipliers);
  EXPECT_NE(summary.termination, InteriorPointTermination::kFeasible);
  EXPECT_GE(summary.gamma, 1 - 1e-6);
  EXPECT_EQ(scene.estimate.translations, before.translations);
  EXPECT_EQ(scene.estimate.points, before.points);
}

INSTANTIATE_TEST_SUITE_P(
    Norms, InteriorPoint,
    testing::Values(1, 2, std::numeric_limits<double>::infinity()),
    [](const auto& test) {
      return test.param == 1 ? "L1" : test.param == 2 ? "L2" : "LInf";
    });

TEST(MinimizeJointly, HasNothingToDoWhereTheCostIsZero) {
  RandomScene scene = MakeScene(11, 5);
  for (Observation& o : scene.problem.observations) {
    o.E.bottomRows<2>().setZero();
  }
  const Estimate start = scene.estimate;
  std::vector<Multiplier> multipliers;
  const InteriorPointSummary summary = MinimizeJointly(
      scene.problem, Options(Norm::L2()), {}, &scene.estimate, &multipliers);
  EXPECT_EQ(summary.termination, InteriorPointTermination::kConverged);
  EXPECT_EQ(multipliers.size(), scene.problem.observations.size());
  EXPECT_EQ(scene.estimate.points, start.points);
}

TEST(MinimizeJointly, RefusesStartsBehindACameraAndBadOptions) {
  RandomScene scene = MakeScene(12, 5);
  std::vector<Multiplier> multipliers;
  const auto run = [&](const InteriorPointOptions& options) {
    MinimizeJointly(scene.problem, options, {}, &scene.estimate, &multipliers);
  };
  InteriorPointOptions options = Options({3});
  EXPECT_THROW(run(options), std::invalid_argument);
  options = Options(Norm::L2());
  options.max_iterations = 0;
  EXPECT_THROW(run(options), std::invalid_argument);
  options = Options(Norm::L2());
  options.smallest_gap = 0;
  EXPECT_THROW(run(options), std::invalid_argument);
  options = Options(Norm::L2());
  options.start_margin = 0;
  EXPECT_THROW(run(options), std::invalid_argument);
  options = Options(Norm::L2());
  const std::vector<Multiplier> too_few(3);
  options.known_multipliers = &too_few;
  EXPECT_THROW(run(options), std::invalid_argument);
  scene.estimate.points[0] *= -1;
  EXPECT_THROW(run(Options(Norm::L2())), std::invalid_argument);
}

TEST(FindFeasible, RefusesBoundsAndDepthsThatAreNotPositive) {
  RandomScene scene = MakeScene(13, 5);
  std::vector<Multiplier> multipliers;
  const auto run = [&](double bound, double unit_depth) {
    FindFeasible(scene.problem, Options(Norm::L2()), {}, bound, unit_depth,
                 &scene.estimate, &multipliers);
  };
  EXPECT_THROW(run(0, 1), std::invalid_argument);
  EXPECT_THROW(run(1, 0), std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
