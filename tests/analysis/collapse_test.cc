#include "krot/analysis/model_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

SyntheticScene CollapsingScene() {
  SceneOptions options = SceneOf(6, 60);
  options.start_point_noise = 0.01;
  return SynthesizeScene(options);
}

// A point as near to the camera of its first observation.
void PutIntoCamera(Model* model, size_t k, double distance) {
  Point3D& point = model->points3D[k];
  const ImageId id = model->track_elements[point.track_begin].image_id;
  const RigidTransform cam_from_world =
      ImageGeometries(*model)[ImageIndices(*model).at(id)].cam_from_world;
  point.xyz = Center(cam_from_world) +
              distance * cam_from_world.rotation.transpose().col(2);
}

TEST(Collapse, IsNotWhereAModelImproves) {
  const SyntheticScene scene = CollapsingScene();
  const Collapse collapse = FindCollapse(scene.model, scene.ground_truth);
  EXPECT_FALSE(collapse.Any());
  EXPECT_FALSE(collapse.IsWhole());
  EXPECT_EQ(collapse.num_points,
            static_cast<int64_t>(scene.model.points3D.size()));
}

TEST(Collapse, NamesPointsThatCameToLieInACamera) {
  const Model before = CollapsingScene().model;
  Model after = before;
  PutIntoCamera(&after, 3, 1e-9);
  PutIntoCamera(&after, 5, 1e-3);  // near, but it has a position
  const Collapse collapse = FindCollapse(before, after);
  EXPECT_THAT(collapse.in_camera, ElementsAre(before.points3D[3].id));
  EXPECT_THAT(collapse.at_infinity, IsEmpty());
  EXPECT_FALSE(collapse.IsWhole());
}

TEST(Collapse, ComparesPointsOfTheSameIdWhereOthersWereRemoved) {
  const Model before = CollapsingScene().model;
  Model after = before;
  PutIntoCamera(&after, 3, 1e-9);
  after.points3D.erase(after.points3D.begin());
  const Collapse collapse = FindCollapse(before, after);
  EXPECT_THAT(collapse.in_camera, ElementsAre(before.points3D[3].id));
  EXPECT_EQ(collapse.num_points,
            static_cast<int64_t>(before.points3D.size()) - 1);
}

TEST(Collapse, NamesPointsThatWentToInfinity) {
  const Model before = CollapsingScene().model;
  Model after = before;
  after.points3D[4].xyz *= 1e9;
  const Collapse collapse = FindCollapse(before, after);
  EXPECT_THAT(collapse.at_infinity, ElementsAre(before.points3D[4].id));
  EXPECT_THAT(collapse.in_camera, IsEmpty());
}

TEST(Collapse, IsNotWhatWasThereBefore) {
  Model before = CollapsingScene().model;
  PutIntoCamera(&before, 3, 1e-9);
  before.points3D[4].xyz *= 1e9;
  Model after = before;
  PutIntoCamera(&after, 3, 1e-10);
  EXPECT_FALSE(FindCollapse(before, after).Any());
}

TEST(Collapse, CountsWhereThereWasNoPositionBefore) {
  Model before = CollapsingScene().model;
  Model after = before;
  for (Frame& frame : before.frames) {
    frame.rig_from_world.translation.setConstant(std::nan(""));
  }
  EXPECT_FALSE(FindCollapse(before, after).Any());
  after.points3D[4].xyz *= 1e9;
  EXPECT_THAT(FindCollapse(before, after).at_infinity,
              ElementsAre(before.points3D[4].id));
}

TEST(Collapse, IsWholeWhereMostPointsFell) {
  const Model before = CollapsingScene().model;
  Model after = before;
  for (size_t k = 0; k < after.points3D.size(); ++k) {
    PutIntoCamera(&after, k, 1e-9);
    if (k == after.points3D.size() / 2 - 1) {
      EXPECT_FALSE(FindCollapse(before, after).IsWhole());
    }
  }
  EXPECT_TRUE(FindCollapse(before, after).IsWhole());
}

TEST(Collapse, IsWholeWhereAllPointsBecomeOne) {
  const Model before = CollapsingScene().model;
  Model after = before;
  for (Point3D& point : after.points3D) point.xyz *= 1e-9;
  const Collapse collapse = FindCollapse(before, after);
  EXPECT_TRUE(collapse.is_in_one_place);
  EXPECT_TRUE(collapse.IsWhole());
  after.points3D[7].xyz *= 1e9;
  EXPECT_FALSE(FindCollapse(before, after).is_in_one_place);
}

}  // namespace
}  // namespace krot::internal
