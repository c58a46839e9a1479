#include "krot/conic/interior_point.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "krot/minimax/residual_set.h"
#include "krot/problem/cost.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

RandomScene MakeSlackScene(unsigned seed, double baseline = 0) {
  RandomSceneOptions options = {5, 40, baseline > 0 ? 2 : 1, baseline};
  options.seed = seed;
  return MakeRandomScene(options);
}

// The objective by its definition, from the estimate alone: what observations
// exceed the bound by, over their depths at the start.
double SumOfSlack(const RandomScene& scene, double bound, Norm norm,
                  const Estimate& estimate) {
  double sum = 0;
  for (const Observation& o : scene.problem.observations) {
    const ViewedPoint at_start = ViewPoint(scene.problem, o, scene.estimate);
    const ViewedPoint viewed = ViewPoint(scene.problem, o, estimate);
    sum += std::max(0.0, NormOf(viewed.v, norm) - bound * viewed.depth) /
           at_start.depth;
  }
  return sum;
}

std::vector<Eigen::Vector3d> CentredCentres(const RandomScene& scene,
                                            const Estimate& estimate) {
  std::vector<Eigen::Vector3d> centres;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const View& view : scene.problem.views) {
    centres.push_back(-view.cam_from_world_rotation.transpose() *
                      view.cam_from_rig_rotation *
                      estimate.translations[view.frame]);
    mean += centres.back() / static_cast<double>(scene.problem.views.size());
  }
  for (Eigen::Vector3d& centre : centres) centre -= mean;
  return centres;
}

// How large the frames' centres are along those at the start, which is kept at
// 1. One view per frame.
double Size(const RandomScene& scene, const Estimate& estimate) {
  const std::vector<Eigen::Vector3d> at_start =
      CentredCentres(scene, scene.estimate);
  const std::vector<Eigen::Vector3d> centres = CentredCentres(scene, estimate);
  double along = 0;
  double square = 0;
  for (size_t f = 0; f < centres.size(); ++f) {
    along += centres[f].dot(at_start[f]);
    square += at_start[f].squaredNorm();
  }
  return along / square;
}

TEST(MinimizeSlack, LeavesNoneWhereTheBoundIsTheCostOfTheStart) {
  for (const Norm norm : {Norm::L1(), Norm::L2(), Norm::LInf()}) {
    for (const double baseline : {0.0, 0.1}) {
      const RandomScene scene = MakeSlackScene(1, baseline);
      const double cost = Cost(scene.problem, scene.estimate, norm, 1);
      SlackOptions options;
      options.norm = norm;
      Estimate estimate = scene.estimate;
      const SlackSolution solution =
          MinimizeSlack(scene.problem, 1.01 * cost, options, {}, &estimate);
      EXPECT_EQ(solution.termination, InteriorPointTermination::kConverged);
      EXPECT_LT(Cost(scene.problem, estimate, norm, 1), 1.02 * cost);
      for (const double slack : solution.slack) {
        EXPECT_LT(slack, 1e-2 * cost);
      }
    }
  }
}

TEST(MinimizeSlack, FindsAnEstimateWithinTheBoundFromNothing) {
  for (const Norm norm : {Norm::L1(), Norm::L2(), Norm::LInf()}) {
    const RandomScene scene = MakeSlackScene(5);
    const double bound = 1.01 * Cost(scene.problem, scene.estimate, norm, 1);
    SlackOptions options;
    options.norm = norm;
    Estimate estimate = scene.estimate;
    for (Eigen::Vector3d& s : estimate.points) s.setZero();
    for (Eigen::Vector3d& t : estimate.translations) t.setZero();
    MinimizeSlack(scene.problem, bound, options, {}, &estimate);
    EXPECT_TRUE(AllDepthsPositive(scene.problem, estimate, 1));
    EXPECT_LT(Cost(scene.problem, estimate, norm, 1), 1.01 * bound);
  }
}

// A convex function: nothing nearby is lower than a minimum, up to the gap that
// the interior point leaves.
TEST(MinimizeSlack, CannotBeLoweredByAnyNearbyEstimate) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (const Norm norm : {Norm::L1(), Norm::L2(), Norm::LInf()}) {
    const RandomScene scene = MakeSlackScene(2);
    const double cost = Cost(scene.problem, scene.estimate, norm, 1);
    const double bound = 0.1 * cost;
    SlackOptions options;
    options.norm = norm;
    options.smallest_mu = 1e-8;
    Estimate estimate = scene.estimate;
    MinimizeSlack(scene.problem, bound, options, {}, &estimate);
    const double least = SumOfSlack(scene, bound, norm, estimate);
    EXPECT_LT(least, SumOfSlack(scene, bound, norm, scene.estimate));
    EXPECT_NEAR(Size(scene, estimate), 1, 1e-6);
    for (int n = 0; n < 2000; ++n) {
      Estimate nearby = estimate;
      const double size = std::pow(10, -1 - n % 4);
      const auto shake = [&](Eigen::Vector3d* x) {
        for (int k = 0; k < 3; ++k) (*x)[k] += size * normal(random);
      };
      if (n % 2 == 0) {
        shake(&nearby.points[n / 2 % nearby.points.size()]);
      } else {
        for (Eigen::Vector3d& s : nearby.points) shake(&s);
        for (Eigen::Vector3d& t : nearby.translations) shake(&t);
      }
      const double scale = 1 / Size(scene, nearby);
      if (!(scale > 0)) continue;
      for (Eigen::Vector3d& s : nearby.points) s *= scale;
      for (Eigen::Vector3d& t : nearby.translations) t *= scale;
      EXPECT_GE(SumOfSlack(scene, bound, norm, nearby),
                least * (1 - 1e-4) - 1e-6 * bound);
    }
  }
}

TEST(MinimizeSlack, EndsWithTheGapAskedForHoweverFarApartTheWeightsAre) {
  for (const Norm norm : {Norm::L1(), Norm::L2(), Norm::LInf()}) {
    const RandomScene scene = MakeSlackScene(6);
    const double cost = Cost(scene.problem, scene.estimate, norm, 1);
    SlackOptions options;
    options.norm = norm;
    for (size_t i = 0; i < scene.problem.observations.size(); ++i) {
      options.weights.push_back(i % 5 == 0 ? 1e-7 : 1);
    }
    Estimate estimate = scene.estimate;
    const SlackSolution solution =
        MinimizeSlack(scene.problem, 0.2 * cost, options, {}, &estimate);
    EXPECT_EQ(solution.termination, InteriorPointTermination::kConverged);
  }
}

TEST(MinimizeSlack, RefusesOptionsOutOfRange) {
  const RandomScene scene = MakeSlackScene(4);
  Estimate estimate = scene.estimate;
  SlackOptions options;
  EXPECT_THROW(MinimizeSlack(scene.problem, 0, options, {}, &estimate),
               std::invalid_argument);
  options.norm.p = 3;
  EXPECT_THROW(MinimizeSlack(scene.problem, 1, options, {}, &estimate),
               std::invalid_argument);
  options = {};
  options.weights = {1};
  EXPECT_THROW(MinimizeSlack(scene.problem, 1, options, {}, &estimate),
               std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
