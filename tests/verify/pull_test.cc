#include "krot/verify/force_checker.h"

#include <gtest/gtest.h>

#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

TEST(Pull, StandsAtThePointOrAtTheCentreOfTheView) {
  RandomSceneOptions options;
  options.views_per_frame = 2;
  options.baseline = 0.3;
  const RandomScene scene = MakeRandomScene(options);
  const KnownRotationProblem& problem = scene.problem;
  const Vector3d direction(0.2, -0.5, 0.7);
  const Pull of_point{Pull::Kind::kPoint, 4, direction};
  EXPECT_EQ(PositionOf(problem, scene.estimate, of_point),
            scene.estimate.points[4]);
  const Pull of_view{Pull::Kind::kView, 3, direction};
  const Vector3d centre = PositionOf(problem, scene.estimate, of_view);
  const View& view = problem.views[3];
  const Vector3d in_camera =
      view.cam_from_world_rotation * centre +
      view.cam_from_rig_rotation * scene.estimate.translations[view.frame] +
      view.cam_from_rig_translation;
  EXPECT_LT(in_camera.norm(), 1e-14);
  EXPECT_EQ(Along(problem, scene.estimate, of_view), direction.dot(centre));
}

TEST(Pull, IsFixedWhereItsPointOrItsViewsFrameIs) {
  RandomSceneOptions options;
  options.views_per_frame = 2;
  KnownRotationProblem problem = MakeRandomScene(options).problem;
  for (const Pull::Kind kind : {Pull::Kind::kPoint, Pull::Kind::kView}) {
    for (int32_t n = 0; n < 10; ++n) {
      EXPECT_FALSE(IsFixedPosition(problem, {kind, n}));
    }
  }
  problem.fixed_translations.resize(problem.num_frames);
  problem.fixed_translations[2] = Vector3d::Zero();
  problem.fixed_points.resize(problem.num_points);
  problem.fixed_points[4] = Vector3d::Zero();
  for (int32_t n = 0; n < 10; ++n) {
    EXPECT_EQ(IsFixedPosition(problem, {Pull::Kind::kPoint, n}), n == 4);
    EXPECT_EQ(IsFixedPosition(problem, {Pull::Kind::kView, n}),
              problem.views[n].frame == 2);
  }
}

// Where points and views are called differently.
TEST(Pull, IsAtTheSamePositionInAPart) {
  const RandomScene scene = MakeRandomScene(RandomSceneOptions());
  std::vector<int64_t> observations;  // of all points but three, two views
  for (size_t i = 0; i < scene.problem.observations.size(); ++i) {
    const Observation& observation = scene.problem.observations[i];
    if (observation.point >= 3 && observation.view % 2 == 1) {
      observations.push_back(static_cast<int64_t>(i));
    }
  }
  const ProblemSubset part(scene.problem, observations);
  const Estimate estimate = part.Restrict(scene.estimate);
  for (const Pull::Kind kind : {Pull::Kind::kPoint, Pull::Kind::kView}) {
    const Pull pull{kind, 3, {0.2, -0.5, 0.7}};
    const std::optional<Pull> placed = InPart(part, pull);
    ASSERT_TRUE(placed);
    EXPECT_EQ(placed->direction, pull.direction);
    EXPECT_EQ(PositionOf(part.problem(), estimate, *placed),
              PositionOf(scene.problem, scene.estimate, pull));
    EXPECT_FALSE(InPart(part, {kind, 2}));
  }
}

}  // namespace
}  // namespace krot::internal
