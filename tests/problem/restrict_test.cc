#include "krot/problem/restrict.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/problem/cost.h"
#include "tests/problem/graph_problem.h"
#include "tests/problem/random_problem.h"

namespace krot {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<int64_t> All(const KnownRotationProblem& problem) {
  std::vector<int64_t> all(problem.observations.size());
  std::iota(all.begin(), all.end(), int64_t{0});
  return all;
}

TEST(RestrictProblem, KeepsOnlyWhatTheObservationsSeeInTheirOrder) {
  const RestrictedProblem part = RestrictProblem(
      MakeGraph(5, 4, {{0, 0}, {4, 0}, {2, 1}, {1, 3}, {4, 3}}), {1, 3, 4});
  EXPECT_THAT(part.observation_of, ElementsAre(1, 3, 4));
  EXPECT_THAT(part.point_of, ElementsAre(0, 3));
  EXPECT_THAT(part.frame_of, ElementsAre(1, 4));
  EXPECT_THAT(part.view_of, ElementsAre(1, 4));
  EXPECT_THAT(part.problem.point_begin, ElementsAre(0, 1, 3));
  EXPECT_THAT(part.problem.frame_begin, ElementsAre(0, 1, 3));
}

TEST(RestrictProblem, KeepsEveryResidualAndTheEstimateGoesThereAndBack) {
  RandomSceneOptions options;
  options.views_per_frame = 2;
  options.baseline = 0.3;
  const RandomScene scene = MakeRandomScene(options);
  std::vector<int64_t> observations;
  for (size_t i = 3; i < scene.problem.observations.size(); i += 7) {
    observations.push_back(static_cast<int64_t>(i));
  }
  const RestrictedProblem part = RestrictProblem(scene.problem, observations);
  Estimate estimate = RestrictEstimate(part, scene.estimate);
  for (size_t n = 0; n < observations.size(); ++n) {
    const ViewedPoint whole =
        ViewPoint(scene.problem, scene.problem.observations[observations[n]],
                  scene.estimate);
    const ViewedPoint restricted =
        ViewPoint(part.problem, part.problem.observations[n], estimate);
    EXPECT_EQ(whole.depth, restricted.depth);
    EXPECT_EQ(whole.v, restricted.v);
  }

  Estimate copy = scene.estimate;
  ReplaceEstimate(part, estimate, &copy);
  EXPECT_EQ(copy.points, scene.estimate.points);
  EXPECT_EQ(copy.translations, scene.estimate.translations);
  estimate.points.back().setConstant(7);
  ReplaceEstimate(part, estimate, &copy);
  EXPECT_EQ(copy.points[part.point_of.back()], Eigen::Vector3d(7, 7, 7));
}

TEST(RestrictProblem, RefusesIndicesThatDoNotAscendOrDoNotExist) {
  const KnownRotationProblem problem = MakeGraph(2, 1, {{0, 0}, {1, 0}});
  EXPECT_THROW(RestrictProblem(problem, {1, 0}), std::invalid_argument);
  EXPECT_THROW(RestrictProblem(problem, {0, 0}), std::invalid_argument);
  EXPECT_THROW(RestrictProblem(problem, {2}), std::invalid_argument);
  EXPECT_THROW(RestrictProblem(problem, {-1}), std::invalid_argument);
}

TEST(SplitIntoComponents, GivesEachConnectedPartItsObservations) {
  const KnownRotationProblem problem =
      MakeGraph(4, 3, {{3, 0}, {1, 0}, {2, 1}, {0, 1}, {3, 2}});
  EXPECT_THAT(SplitIntoComponents(problem, All(problem)),
              ElementsAre(ElementsAre(2, 3), ElementsAre(0, 1, 4)));
  EXPECT_THAT(SplitIntoComponents(problem, {0, 2}),
              ElementsAre(ElementsAre(1 + 1), ElementsAre(0)));
  EXPECT_THAT(SplitIntoComponents(problem, {}), IsEmpty());
}

TEST(PruneUnconstrained, KeepsWhereEveryPointAndFrameHasTwo) {
  const KnownRotationProblem problem =
      MakeGraph(2, 2, {{0, 0}, {1, 0}, {0, 1}, {1, 1}});
  EXPECT_THAT(PruneUnconstrained(problem, All(problem)),
              ElementsAre(0, 1, 2, 3));
}

TEST(PruneUnconstrained, KeepsAPointThatOneImageSeesTwice) {
  const KnownRotationProblem problem =
      MakeGraph(2, 2, {{0, 0}, {0, 0}, {0, 1}, {1, 1}});
  EXPECT_THAT(PruneUnconstrained(problem, All(problem)), ElementsAre(0, 1));
}

TEST(PruneUnconstrained, UnravelsAChainFromItsEnds) {
  // frame 0 - point 0 - frame 1 - point 1 - ... : a tree.
  std::vector<std::pair<int, int>> edges;
  for (int k = 0; k < 50; ++k) {
    edges.emplace_back(k, k);
    edges.emplace_back(k + 1, k);
  }
  const KnownRotationProblem problem = MakeGraph(51, 50, edges);
  EXPECT_THAT(PruneUnconstrained(problem, All(problem)), IsEmpty());
}

TEST(PruneUnconstrained, LeavesTheCycleThatAChainHangsOn) {
  const KnownRotationProblem problem = MakeGraph(
      4, 4, {{0, 0}, {1, 0}, {0, 1}, {1, 1}, {1, 2}, {2, 2}, {2, 3}, {3, 3}});
  EXPECT_THAT(PruneUnconstrained(problem, All(problem)),
              ElementsAre(0, 1, 2, 3));
}

}  // namespace
}  // namespace krot
