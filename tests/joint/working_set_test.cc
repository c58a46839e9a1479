
#include <algorithm>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

RandomScene MakeScene() { return MakeRandomScene({6, 60}); }

// The error of an observation in pixels, from the pose of its camera.
double ErrorOf(const RandomScene& scene, const Observation& observation) {
  const View& view = scene.problem.views[observation.view];
  const Eigen::Vector3d x_cam =
      view.cam_from_world_rotation * scene.estimate.points[observation.point] +
      view.cam_from_rig_rotation * scene.estimate.translations[view.frame] +
      view.cam_from_rig_translation;
  const Eigen::Vector3d wv = observation.E * x_cam;
  return wv.tail<2>().norm() / wv[0];
}

// Per frame, its observations of points in the set.
std::vector<int> CountOfFrames(const KnownRotationProblem& problem,
                               const WorkingSet& set) {
  std::vector<int> count(problem.num_frames, 0);
  for (const Observation& o : problem.observations) {
    if (set.Contains(o.point)) ++count[problem.views[o.view].frame];
  }
  return count;
}

TEST(WorkingSet, TakesInTheWorstPointsAboveALevel) {
  const RandomScene scene = MakeScene();
  std::vector<double> costs;
  for (int32_t k = 0; k < scene.problem.num_points; ++k) {
    costs.push_back(CostOf(scene.problem, scene.estimate, Norm::L2(),
                           scene.problem.OfPoint(k)));
  }
  EXPECT_EQ(*std::max_element(costs.begin(), costs.end()),
            Cost(scene.problem, scene.estimate, Norm::L2(), 1));
  std::vector<double> sorted = costs;
  std::sort(sorted.rbegin(), sorted.rend());

  WorkingSet set(scene.problem);
  EXPECT_EQ(set.AddAbove(scene.estimate, Norm::L2(), sorted[10], 60), 10);
  for (size_t k = 0; k < costs.size(); ++k) {
    EXPECT_EQ(set.Contains(static_cast<int32_t>(k)), costs[k] > sorted[10]);
  }
  EXPECT_EQ(set.AddAbove(scene.estimate, Norm::L2(), 0, 7), 7);
  for (size_t k = 0; k < costs.size(); ++k) {
    EXPECT_EQ(set.Contains(static_cast<int32_t>(k)), costs[k] > sorted[17]);
  }
}

TEST(WorkingSet, TakesInAPointBehindACameraFirst) {
  RandomScene scene = MakeScene();
  scene.estimate.points[31] *= -1;
  WorkingSet set(scene.problem);
  EXPECT_EQ(set.AddAbove(scene.estimate, Norm::L2(), 1e6, 60), 1);
  EXPECT_TRUE(set.Contains(31));
}

// Every observation of the points that come in is above the share of the level
// or among the worst four of its point; and no other that is so stays outside.
TEST(WorkingSet, TakesOfAPointWhatIsNearTheLevelAndFourAtLeast) {
  const RandomScene scene = MakeScene();
  const KnownRotationProblem& problem = scene.problem;
  const double level =
      0.5 * Cost(problem, scene.estimate, Norm::L2(), /*num_threads=*/1);
  WorkingSet set(problem);
  const int64_t num_added =
      set.AddAbove(scene.estimate, Norm::L2(), level, 60, 0.7);
  EXPECT_GT(num_added, 5);
  EXPECT_EQ(set.num_points(), num_added);
  const std::vector<int64_t> taken = set.Observations();
  EXPECT_LT(taken.size(), 5 * static_cast<size_t>(num_added));  // of six
  for (int32_t k = 0; k < problem.num_points; ++k) {
    const bool is_above =
        CostOf(problem, scene.estimate, Norm::L2(), problem.OfPoint(k)) > level;
    EXPECT_EQ(set.Contains(k), is_above);
    std::vector<double> errors;
    for (int64_t i = problem.point_begin[k]; i < problem.point_begin[k + 1];
         ++i) {
      errors.push_back(ErrorOf(scene, problem.observations[i]));
    }
    std::sort(errors.rbegin(), errors.rend());
    for (int64_t i = problem.point_begin[k]; i < problem.point_begin[k + 1];
         ++i) {
      const double error = ErrorOf(scene, problem.observations[i]);
      EXPECT_EQ(std::binary_search(taken.begin(), taken.end(), i),
                is_above && (error >= 0.7 * level || error >= errors[3]));
    }
  }
}

// What is inside of the set is no reason to take a point in once more.
TEST(WorkingSet, TakesAPointInAgainForWhatIsOutside) {
  const RandomScene scene = MakeScene();
  const double cost = Cost(scene.problem, scene.estimate, Norm::L2(), 1);
  WorkingSet set(scene.problem);
  const int64_t first =
      set.AddAbove(scene.estimate, Norm::L2(), 0.9 * cost, 60, 1);
  EXPECT_GT(first, 0);
  EXPECT_EQ(set.AddAbove(scene.estimate, Norm::L2(), 0.9 * cost, 60), 0);
  EXPECT_FALSE(set.IsAll());
  EXPECT_EQ(set.AddAbove(scene.estimate, Norm::L2(), 0, 60), 60);
  EXPECT_EQ(set.num_points(), 60);
  EXPECT_TRUE(set.IsAll());
}

// The scale is free, or set by baselines of a share of the depths.
TEST(ShareOfLevel, IsOneOfWholePointsWhereBaselinesAreTiny) {
  const auto share_of = [](double baseline) {
    RandomSceneOptions options;
    options.views_per_frame = 2;
    options.baseline = baseline;
    const RandomScene scene = MakeRandomScene(options);
    return ShareOfLevel(scene.problem, scene.estimate, {});
  };
  EXPECT_GT(share_of(0), 0);
  EXPECT_EQ(share_of(1e-6), 0);
  EXPECT_EQ(share_of(1e-4), 0);
  EXPECT_GT(share_of(1), 0);
}

TEST(WorkingSet, TiesEveryFrameAndTakesNoMoreThanThatNeeds) {
  const RandomScene scene = MakeScene();
  WorkingSet set(scene.problem);
  set.AddTies(9);
  for (const int count : CountOfFrames(scene.problem, set)) {
    EXPECT_GE(count, 9);
  }
  EXPECT_EQ(set.num_points(), 9);  // every point is seen by all
  set.AddTies(1000);
  EXPECT_TRUE(set.IsAll());
  EXPECT_EQ(set.Observations().size(), scene.problem.observations.size());
}

TEST(WorkingSet, ListsAllObservationsOfItsPointsInOrder) {
  const RandomScene scene = MakeScene();
  WorkingSet set(scene.problem);
  EXPECT_TRUE(set.Observations().empty());
  set.AddTies(3);
  const std::vector<int64_t> observations = set.Observations();
  EXPECT_TRUE(std::is_sorted(observations.begin(), observations.end()));
  for (size_t i = 0; i < scene.problem.observations.size(); ++i) {
    EXPECT_EQ(std::binary_search(observations.begin(), observations.end(),
                                 static_cast<int64_t>(i)),
              set.Contains(scene.problem.observations[i].point));
  }
}

TEST(WorkingSet, CostsWhatItsPointsCost) {
  const RandomScene scene = MakeScene();
  WorkingSet set(scene.problem);
  EXPECT_EQ(set.Cost(scene.estimate, Norm::L2()), 0);
  set.AddTies(9);
  const auto expected = [&] {
    double largest = 0;
    for (const Observation& observation : scene.problem.observations) {
      if (!set.Contains(observation.point)) continue;
      largest = std::max(largest, ErrorOf(scene, observation));
    }
    return largest;
  };
  const double of_ties = expected();
  EXPECT_NEAR(set.Cost(scene.estimate, Norm::L2()), of_ties, 1e-11 * of_ties);
  set.AddAll();
  const double of_all = expected();
  EXPECT_GT(of_all, of_ties);
  EXPECT_NEAR(set.Cost(scene.estimate, Norm::L2()), of_all, 1e-11 * of_all);
}

// The bound is proved for all observations, whatever the solver looked at.
TEST(WorkingSet, OfFewPointsHasTheOptimumOfAll) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    RandomSceneOptions random = {5, 800};
    random.seed = seed;
    RandomScene scene = MakeRandomScene(random);
    JointOptions options;
    options.norm = Norm::L2();
    options.relative_gap = 1e-6;
    const JointSummary summary =
        SolveJoint(scene.problem, options, {}, &scene.estimate);
    EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
    EXPECT_LT(4 * summary.num_working_observations,
              3 * static_cast<int64_t>(scene.problem.observations.size()));
    ASSERT_TRUE(summary.certificate);
    const CertificateCheck check =
        CheckCertificate(scene.problem, Norm::L2(), *summary.certificate);
    EXPECT_TRUE(check.is_accepted) << check.refusal;
    EXPECT_GE(check.proved_bound,
              (1 - 1e-6) * Cost(scene.problem, scene.estimate, Norm::L2(), 1));
  }
}

using testing::ElementsAre;
using testing::IsEmpty;

std::vector<Multiplier> WithLambdas(const std::vector<double>& lambdas) {
  std::vector<Multiplier> multipliers;
  for (const double lambda : lambdas) {
    multipliers.push_back({lambda, {lambda / 4, -lambda / 8}});
  }
  return multipliers;
}

std::vector<double> LambdasOf(const KnownMultipliers& known,
                              const std::vector<int64_t>& names) {
  std::vector<double> lambdas;
  for (const auto& [lambda, y] : known.Of(names)) {
    lambdas.push_back(lambda);
    EXPECT_EQ(y, Eigen::Vector2d(lambda / 4, -lambda / 8));
  }
  return lambdas;
}

TEST(KnownMultipliers, AreZeroWhereTheyAreNotKnown) {
  KnownMultipliers known;
  known.Keep({2, 5, 9}, WithLambdas({20, 50, 90}), 1);
  EXPECT_THAT(LambdasOf(known, {2, 5, 9}), ElementsAre(20, 50, 90));
  EXPECT_THAT(LambdasOf(known, {0, 2, 3, 9, 11}), ElementsAre(0, 20, 0, 90, 0));
}

TEST(KnownMultipliers, AreEmptyWhereNoneIsKnown) {
  KnownMultipliers known;
  EXPECT_THAT(known.Of({0, 1}), IsEmpty());
  known.Keep({2, 5}, WithLambdas({20, 50}), 1);
  EXPECT_THAT(known.Of({0, 3, 4, 6}), IsEmpty());
  EXPECT_THAT(known.Of({}), IsEmpty());
}

TEST(KnownMultipliers, AreTheLatestThatWereKept) {
  KnownMultipliers known;
  EXPECT_EQ(known.optimum(), 0);
  known.Keep({2, 5, 9}, WithLambdas({20, 50, 90}), 1);
  known.Keep({1, 5, 6}, WithLambdas({10, 55, 60}), 2);
  EXPECT_EQ(known.optimum(), 2);
  EXPECT_THAT(LambdasOf(known, {1, 2, 5, 6, 9}),
              ElementsAre(10, 20, 55, 60, 90));
}

}  // namespace
}  // namespace krot::internal
