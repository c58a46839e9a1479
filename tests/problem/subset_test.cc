#include "krot/problem/subset.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/problem/cost.h"
#include "tests/problem/graph_problem.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<int64_t> All(const KnownRotationProblem& problem) {
  std::vector<int64_t> all(problem.observations.size());
  std::iota(all.begin(), all.end(), int64_t{0});
  return all;
}

TEST(ProblemSubset, KeepsOnlyWhatTheObservationsSeeInTheirOrder) {
  const KnownRotationProblem whole =
      MakeGraph(5, 4, {{0, 0}, {4, 0}, {2, 1}, {1, 3}, {4, 3}});
  const ProblemSubset part(whole, {1, 3, 4});
  EXPECT_FALSE(part.IsWhole());
  EXPECT_THAT(part.InWhole({0, 1, 2}), ElementsAre(1, 3, 4));
  EXPECT_THAT(part.problem().point_begin, ElementsAre(0, 1, 3));
  EXPECT_THAT(part.problem().frame_begin, ElementsAre(0, 1, 3));
  Estimate estimate;
  for (int n = 0; n < 5; ++n) {
    estimate.translations.push_back(Eigen::Vector3d::Constant(n));
    if (n < 4) estimate.points.push_back(Eigen::Vector3d::Constant(10 + n));
  }
  const Estimate seen = part.Restrict(estimate);
  EXPECT_THAT(seen.translations, ElementsAre(Eigen::Vector3d::Constant(1),
                                             Eigen::Vector3d::Constant(4)));
  EXPECT_THAT(seen.points, ElementsAre(Eigen::Vector3d::Constant(10),
                                       Eigen::Vector3d::Constant(13)));
}

TEST(ProblemSubset, OfEverythingIsTheProblemItself) {
  const RandomScene scene = MakeRandomScene({});
  const ProblemSubset all(scene.problem, All(scene.problem));
  EXPECT_TRUE(all.IsWhole());
  EXPECT_EQ(&all.problem(), &scene.problem);
  EXPECT_EQ(all.InWhole(5), 5);
  EXPECT_EQ(all.Restrict(scene.estimate).points, scene.estimate.points);
  Estimate moved = scene.estimate;
  moved.points.back().setConstant(7);
  Estimate copy = scene.estimate;
  all.Replace(moved, &copy);
  EXPECT_EQ(copy.points, moved.points);
}

TEST(ProblemSubset, OfAllObservationsLeavesOutWhatNoneOfThemSees) {
  const KnownRotationProblem whole = MakeGraph(3, 2, {{0, 1}, {2, 1}});
  const ProblemSubset part(whole, All(whole));
  EXPECT_FALSE(part.IsWhole());
  EXPECT_EQ(part.problem().num_frames, 2);
  EXPECT_EQ(part.problem().num_points, 1);
}

TEST(ProblemSubset, KeepsEveryResidualAndTheEstimateGoesThereAndBack) {
  RandomSceneOptions options;
  options.views_per_frame = 2;
  options.baseline = 0.3;
  const RandomScene scene = MakeRandomScene(options);
  std::vector<int64_t> observations;
  for (size_t i = 3; i < scene.problem.observations.size(); i += 7) {
    observations.push_back(static_cast<int64_t>(i));
  }
  const ProblemSubset part(scene.problem, observations);
  Estimate estimate = part.Restrict(scene.estimate);
  for (size_t n = 0; n < observations.size(); ++n) {
    const ViewedPoint whole =
        ViewPoint(scene.problem, scene.problem.observations[observations[n]],
                  scene.estimate);
    const ViewedPoint restricted =
        ViewPoint(part.problem(), part.problem().observations[n], estimate);
    EXPECT_EQ(whole.depth, restricted.depth);
    EXPECT_EQ(whole.v, restricted.v);
  }

  Estimate copy = scene.estimate;
  part.Replace(estimate, &copy);
  EXPECT_EQ(copy.points, scene.estimate.points);
  EXPECT_EQ(copy.translations, scene.estimate.translations);
  estimate.points.back().setConstant(7);
  part.Replace(estimate, &copy);
  const int32_t last = scene.problem.observations[observations.back()].point;
  EXPECT_EQ(copy.points[last], Eigen::Vector3d(7, 7, 7));
}

TEST(ProblemSubset, RefusesIndicesThatDoNotAscendOrDoNotExist) {
  const KnownRotationProblem problem = MakeGraph(2, 1, {{0, 0}, {1, 0}});
  EXPECT_THROW(ProblemSubset(problem, {1, 0}), std::invalid_argument);
  EXPECT_THROW(ProblemSubset(problem, {0, 0}), std::invalid_argument);
  EXPECT_THROW(ProblemSubset(problem, {2}), std::invalid_argument);
  EXPECT_THROW(ProblemSubset(problem, {-1}), std::invalid_argument);
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
}  // namespace krot::internal
