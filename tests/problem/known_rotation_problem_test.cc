#include "krot/problem/known_rotation_problem.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

namespace krot::internal {
namespace {

using ::testing::ElementsAre;

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

}  // namespace
}  // namespace krot::internal
