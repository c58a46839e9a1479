#include <cstdint>

#include <gtest/gtest.h>
#include <Eigen/Core>

#include "krot/joint/component_solve.h"
#include "krot/problem/cost.h"
#include "tests/joint/small_scenes.h"

namespace krot::internal {
namespace {

// Two scenes in one problem, of which the second is `scale` times as large.
RandomScene WithAPartOfScale(double scale) {
  RandomScene part = MakeSmallScene(2);
  for (auto* vectors : {&part.estimate.translations, &part.estimate.points}) {
    for (Eigen::Vector3d& vector : *vectors) vector *= scale;
  }
  return Glue(MakeSmallScene(1), part);
}

TEST(HasTinyParts, IsAboutFramesNotAboutSinglePoints) {
  RandomScene scene = WithAPartOfScale(1);
  EXPECT_FALSE(HasTinyParts(scene.problem, scene.estimate));
  EXPECT_FALSE(HasPointsInCameras(scene.problem, scene.estimate));

  // One point goes to the depth 1e-9 in one camera.
  const Observation& o = scene.problem.observations[0];
  const AffineMap camera =
      CamFromWorld(scene.problem.views[o.view], scene.estimate.translations[0]);
  ASSERT_EQ(scene.problem.views[o.view].frame, 0);
  Eigen::Vector3d& point = scene.estimate.points[o.point];
  point = CentreOf(camera) + 1e-9 * (point - CentreOf(camera));
  EXPECT_FALSE(HasTinyParts(scene.problem, scene.estimate));
  EXPECT_TRUE(HasPointsInCameras(scene.problem, scene.estimate));
}

TEST(HasTinyParts, FindsAPartOfASmallScale) {
  for (const double scale : {1e-7, 1e7}) {
    const RandomScene scene = WithAPartOfScale(scale);
    EXPECT_TRUE(HasTinyParts(scene.problem, scene.estimate));
  }
  const RandomScene scene = WithAPartOfScale(1e-3);
  EXPECT_FALSE(HasTinyParts(scene.problem, scene.estimate));
}

}  // namespace
}  // namespace krot::internal
