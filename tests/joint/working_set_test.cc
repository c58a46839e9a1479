#include "krot/joint/working_set.h"

#include <algorithm>
#include <limits>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "tests/problem/random_problem.h"

namespace krot {
namespace {

RandomScene MakeScene() {
  RandomSceneOptions options;
  options.num_frames = 6;
  options.num_points = 60;
  return MakeRandomScene(options);
}

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
    costs.push_back(PointCost(scene.problem, scene.estimate, Norm::L2(), k));
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
    RandomSceneOptions random;
    random.num_frames = 5;
    random.num_points = 800;
    random.seed = seed;
    RandomScene scene = MakeRandomScene(random);
    JointOptions options;
    options.norm = Norm::L2();
    options.relative_gap = 1e-6;
    const JointSummary summary =
        SolveJoint(scene.problem, options, {}, &scene.estimate);
    EXPECT_EQ(summary.termination, JointTermination::kGapReached);
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

}  // namespace
}  // namespace krot
