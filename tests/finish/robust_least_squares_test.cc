#include "krot/finish/least_squares.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "krot/problem/cost.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

// Every tenth observation of a noisy scene is 50 pixels off.
RandomScene SceneWithOutliers() {
  RandomSceneOptions options = {8, 60};
  options.seed = 3;
  RandomScene scene = MakeRandomScene(options);
  for (size_t i = 0; i < scene.problem.observations.size(); i += 10) {
    auto& E = scene.problem.observations[i].E;
    E.row(1) += 50 * E.row(0);
  }
  return scene;
}

std::vector<double> Errors(const KnownRotationProblem& problem,
                           const Estimate& estimate) {
  std::vector<double> errors;
  for (const Observation& o : problem.observations) {
    errors.push_back(ResidualOf(ViewPoint(problem, o, estimate), Norm::L2()));
  }
  return errors;
}

double RobustSum(const std::vector<double>& errors, double c) {
  double sum = 0;
  for (const double r : errors) {
    sum += std::isfinite(r) ? c * c * r * r / (c * c + r * r) : c * c;
  }
  return sum;
}

double MedianOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

TEST(MinimizeRobustly, EndsWhereNoSmallMoveLowersTheSum) {
  const RandomScene scene = SceneWithOutliers();
  Estimate estimate = scene.estimate;
  MinimizeRobustly(scene.problem, {}, &estimate);
  const std::vector<double> errors = Errors(scene.problem, estimate);
  const double c = 2 * MedianOf(errors);
  const double sum = RobustSum(errors, c);
  EXPECT_LT(sum, RobustSum(Errors(scene.problem, scene.estimate), c));
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (const double size : {1e-4, 1e-3, 1e-2}) {
    for (int n = 0; n < 20; ++n) {
      Estimate moved = estimate;
      for (auto* vectors : {&moved.translations, &moved.points}) {
        for (Eigen::Vector3d& x : *vectors) {
          x += size *
               Eigen::Vector3d(normal(random), normal(random), normal(random));
        }
      }
      EXPECT_GT(RobustSum(Errors(scene.problem, moved), c), 0.998 * sum);
    }
  }
}

TEST(MinimizeRobustly, HasTheSameBitsAtAnyNumberOfThreads) {
  const RandomScene scene = SceneWithOutliers();
  Estimate one = scene.estimate, four = scene.estimate;
  Context context;
  context.num_threads = 1;
  MinimizeRobustly(scene.problem, context, &one);
  context.num_threads = 4;
  MinimizeRobustly(scene.problem, context, &four);
  EXPECT_EQ(one.translations, four.translations);
  EXPECT_EQ(one.points, four.points);
}

TEST(MinimizeRobustly, LeavesAPointWhereItIsThatNoObservationSees) {
  const RandomScene scene = SceneWithOutliers();
  Estimate estimate = scene.estimate;
  estimate.points[7] = Eigen::Vector3d(0, 0, -5);  // behind every camera
  MinimizeRobustly(scene.problem, {}, &estimate);
  EXPECT_EQ(estimate.points[7], Eigen::Vector3d(0, 0, -5));
  for (const auto* vectors : {&estimate.translations, &estimate.points}) {
    for (const Eigen::Vector3d& x : *vectors) EXPECT_TRUE(x.allFinite());
  }
}

TEST(MinimizeRobustly, LeavesAloneWhatMostObservationsDoNotSee) {
  const RandomScene scene = SceneWithOutliers();
  Estimate estimate = scene.estimate;
  for (Eigen::Vector3d& x : estimate.points) x.setZero();
  for (Eigen::Vector3d& t : estimate.translations) t.setZero();
  const Estimate before = estimate;
  MinimizeRobustly(scene.problem, {}, &estimate);
  EXPECT_EQ(estimate.points, before.points);
  EXPECT_EQ(estimate.translations, before.translations);
}

}  // namespace
}  // namespace krot::internal
