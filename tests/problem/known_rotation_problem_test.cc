#include "krot/problem/known_rotation_problem.h"

#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/problem/cost.h"
#include "krot/problem/subset.h"
#include "tests/problem/graph_problem.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

Observation Sees(int32_t view, int32_t point) {
  return {RowAtRay({0, 0}, Eigen::Matrix2d::Identity()), view, point};
}

// Two frames, the first with two views; point 1 has no observation.
KnownRotationProblem MakeProblem() {
  KnownRotationProblem problem;
  problem.num_frames = 2;
  problem.num_points = 3;
  problem.views.resize(3);
  problem.views[2].frame = 1;
  problem.observations = {Sees(2, 0), Sees(0, 0), Sees(1, 2), Sees(2, 2)};
  return problem;
}

std::string MessageOf(KnownRotationProblem problem) {
  try {
    IndexObservations(&problem);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "nothing thrown";
}

TEST(IndexObservations, ListsThemByPointAndByFrame) {
  KnownRotationProblem problem = MakeProblem();
  IndexObservations(&problem);
  EXPECT_THAT(problem.point_begin, ElementsAre(0, 2, 2, 4));
  EXPECT_THAT(problem.frame_begin, ElementsAre(0, 2, 4));
  EXPECT_THAT(problem.frame_observations, ElementsAre(1, 2, 0, 3));
}

TEST(IndexObservations, OfAnEmptyProblemIsEmpty) {
  KnownRotationProblem problem;
  IndexObservations(&problem);
  EXPECT_THAT(problem.point_begin, ElementsAre(0));
  EXPECT_THAT(problem.frame_begin, ElementsAre(0));
  EXPECT_TRUE(problem.frame_observations.empty());
}

TEST(IndexObservations, MayBeRepeated) {
  KnownRotationProblem problem = MakeProblem();
  IndexObservations(&problem);
  IndexObservations(&problem);
  EXPECT_THAT(problem.frame_observations, ElementsAre(1, 2, 0, 3));
}

TEST(IndexObservations, RefusesAViewOfAFrameThatIsNot) {
  KnownRotationProblem problem = MakeProblem();
  problem.views[1].frame = 2;
  EXPECT_EQ(MessageOf(problem), "views[1].frame = 2, must be >= 0 and < 2");
}

TEST(IndexObservations, RefusesAnObservationOfAViewThatIsNot) {
  KnownRotationProblem problem = MakeProblem();
  problem.observations[3].view = -1;
  EXPECT_EQ(MessageOf(problem),
            "observations[3].view = -1, must be >= 0 and < 3");
}

TEST(IndexObservations, RefusesAnObservationOfAPointThatIsNot) {
  KnownRotationProblem problem = MakeProblem();
  problem.observations[3].point = 3;
  EXPECT_EQ(MessageOf(problem),
            "observations[3].point = 3, must be >= 0 and < 3");
}

TEST(IndexObservations, RefusesObservationsThatAreNotOrderedByPoint) {
  KnownRotationProblem problem = MakeProblem();
  problem.observations[3].point = 1;
  EXPECT_EQ(MessageOf(problem),
            "observations[3].point = 1, must be >= 2, the point of the "
            "observation before it");
}

TEST(Observation, TakesEightyBytes) { EXPECT_EQ(sizeof(Observation), 80); }

// A x + b and c'x + d of a row.
ViewedPoint Evaluate(const double row[kResidualRow], const Eigen::Vector3d& x) {
  const auto affine = [&](const double* r) {
    return r[0] * x[0] + r[1] * x[1] + r[2] * x[2] + r[3];
  };
  return {affine(row + 8), {affine(row), affine(row + 4)}};
}

class ObservationRows : public ::testing::Test {
 protected:
  const RandomScene scene_ = MakeRandomScene(
      {/*num_frames=*/3, /*num_points=*/10, /*views_per_frame=*/2,
       /*baseline=*/0.5, /*seed=*/4});

  // |v| <= 1000 px * 8 units: rounding stays below 1e-11.
  void ExpectSame(const ViewedPoint& row, const Observation& observation) {
    const ViewedPoint expected =
        ViewPoint(scene_.problem, observation, scene_.estimate);
    EXPECT_NEAR(row.depth, expected.depth, 1e-13);
    EXPECT_NEAR(row.v.x(), expected.v.x(), 1e-11);
    EXPECT_NEAR(row.v.y(), expected.v.y(), 1e-11);
  }
};

TEST_F(ObservationRows, OfAnIntersectionAreAffineInThePoint) {
  for (const Observation& observation : scene_.problem.observations) {
    const View& view = scene_.problem.views[observation.view];
    double row[kResidualRow];
    AffineRow(CamFromWorld(view, scene_.estimate.translations[view.frame]),
              observation, row);
    ExpectSame(Evaluate(row, scene_.estimate.points[observation.point]),
               observation);
  }
}

TEST_F(ObservationRows, OfAResectionAreAffineInTheTranslation) {
  for (const Observation& observation : scene_.problem.observations) {
    const View& view = scene_.problem.views[observation.view];
    double row[kResidualRow];
    ResectionRow(view, observation, scene_.estimate.points[observation.point],
                 row);
    ExpectSame(Evaluate(row, scene_.estimate.translations[view.frame]),
               observation);
  }
}

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
