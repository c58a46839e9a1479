#include "krot/problem/subset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/problem/graph_problem.h"

namespace krot::internal {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(FindComponents, NumbersThemByTheirFirstFrame) {
  const Components components =
      FindComponents(MakeGraph(4, 3, {{3, 0}, {1, 0}, {2, 1}, {0, 1}, {3, 2}}));
  EXPECT_EQ(components.count, 2);
  EXPECT_THAT(components.of_frame, ElementsAre(0, 1, 0, 1));
  EXPECT_THAT(components.of_point, ElementsAre(1, 0, 1));
}

TEST(FindComponents, GivesNoneToFramesAndPointsWithoutObservations) {
  const Components components = FindComponents(MakeGraph(3, 2, {{1, 1}}));
  EXPECT_EQ(components.count, 1);
  EXPECT_THAT(components.of_frame, ElementsAre(-1, 0, -1));
  EXPECT_THAT(components.of_point, ElementsAre(-1, 0));
}

TEST(FindComponents, FollowsALongChain) {
  const int length = 1000;
  std::vector<std::pair<int, int>> edges;
  for (int k = 0; k + 1 < length; ++k) {
    edges.emplace_back(length - 1 - k, k);
    edges.emplace_back(length - 2 - k, k);
  }
  const Components components =
      FindComponents(MakeGraph(length, length - 1, edges));
  EXPECT_EQ(components.count, 1);
  EXPECT_THAT(components.of_frame, Each(0));
  EXPECT_THAT(components.of_point, Each(0));
}

TEST(FindComponents, JoinsTheViewsOfOneFrame) {
  KnownRotationProblem problem = MakeGraph(2, 2, {{0, 0}, {1, 1}});
  EXPECT_EQ(FindComponents(problem).count, 2);
  problem.num_frames = 1;
  problem.views[1].frame = 0;
  IndexObservations(&problem);
  EXPECT_EQ(FindComponents(problem).count, 1);
}

TEST(SplitIntoComponents, GivesEachConnectedPartItsObservations) {
  const KnownRotationProblem problem =
      MakeGraph(4, 3, {{3, 0}, {1, 0}, {2, 1}, {0, 1}, {3, 2}});
  EXPECT_THAT(SplitIntoComponents(problem),
              ElementsAre(ElementsAre(2, 3), ElementsAre(0, 1, 4)));
  EXPECT_THAT(SplitIntoComponents(problem, {0, 2}),
              ElementsAre(ElementsAre(1 + 1), ElementsAre(0)));
  EXPECT_THAT(SplitIntoComponents(problem, {}), IsEmpty());
}

}  // namespace
}  // namespace krot::internal
