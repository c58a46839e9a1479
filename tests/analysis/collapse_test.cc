#include "krot/analysis/model_comparison.h"

#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/analysis/model_statistics.h"
#include "krot/context.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"
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

SceneOptions Scene(bool has_rigs) {
  SceneOptions options = SceneOf(4, 40, 3, 0.5);
  options.has_rigs = has_rigs;
  options.sensors_per_rig = has_rigs ? 2 : 1;
  return options;
}

Model SomeModel(bool has_rigs) {
  return SynthesizeScene(Scene(has_rigs)).model;
}

// The errors of both, one after the other.
std::vector<double> BothErrors(const Model& model1, const Model& model2) {
  std::vector<double> errors_px = PixelErrors(model1);
  const std::vector<double> second_px = PixelErrors(model2);
  errors_px.insert(errors_px.end(), second_px.begin(), second_px.end());
  return errors_px;
}

class Overlay : public ::testing::TestWithParam<std::pair<bool, bool>> {
 protected:
  const Model model1_ = SomeModel(GetParam().first);
  const Model model2_ = SomeModel(GetParam().second);
  const Model overlay_ = OverlayModels(model1_, model2_);
};

TEST_P(Overlay, IsAValidModelThatHoldsBoth) {
  ValidateModel(overlay_);
  EXPECT_EQ(overlay_.stores_rigs, model1_.stores_rigs || model2_.stores_rigs);
  const size_t num_images1 = model1_.images.size();
  ASSERT_EQ(overlay_.images.size(), num_images1 + model2_.images.size());
  EXPECT_EQ(overlay_.images[0].name, "1/" + model1_.images[0].name);
  EXPECT_EQ(overlay_.images[num_images1].name, "2/" + model2_.images[0].name);
  EXPECT_EQ(overlay_.points3D.front().color, kOverlayColor1);
  EXPECT_EQ(overlay_.points3D.back().color, kOverlayColor2);
  EXPECT_EQ(overlay_.points3D.front().id, model1_.points3D.front().id);
  EXPECT_EQ(overlay_.points3D.back().id % 10, model2_.points3D.back().id % 10);
}

TEST_P(Overlay, KeepsEveryPixelError) {
  const std::vector<double> expected_px = BothErrors(model1_, model2_);
  const std::vector<double> errors_px = PixelErrors(overlay_);
  ASSERT_EQ(errors_px.size(), expected_px.size());
  for (size_t n = 0; n < errors_px.size(); ++n) {
    EXPECT_NEAR(errors_px[n], expected_px[n], 1e-9);
  }
}

// COLMAP 3.8 reads the poses of images, 4 those of frames.
TEST_P(Overlay, SaysTheSamePosesInImagesAndFrames) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(overlay_);
  for (size_t n = 0; n < geometries.size(); ++n) {
    const Pose& pose = overlay_.images[n].cam_from_world;
    EXPECT_LE((pose.Rotation() - geometries[n].cam_from_world.rotation).norm(),
              1e-14);
    EXPECT_LE(
        (pose.translation - geometries[n].cam_from_world.translation).norm(),
        1e-14);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Models, Overlay,
    ::testing::Values(std::pair(false, false), std::pair(false, true),
                      std::pair(true, false), std::pair(true, true)),
    [](const auto& test) {
      return std::string(test.param.first ? "Rigs" : "Legacy") +
             (test.param.second ? "Rigs" : "Legacy");
    });

TEST(OverlayModels, RefusesIdsThatLeaveTheirRange) {
  Model large = SomeModel(false);
  const ImageId old_id = large.images[0].id;
  large.images[0].id = 4294967290;
  for (TrackElement& element : large.track_elements) {
    if (element.image_id == old_id) element.image_id = 4294967290;
  }
  UseTrivialRigs(&large);
  ValidateModel(large);
  EXPECT_THAT(ModelErrorOf([&] { OverlayModels(large, large); }),
              ::testing::HasSubstr("image ids"));
  EXPECT_THAT(ModelErrorOf([&] { OverlayModels(SomeModel(false), large); }),
              ::testing::HasSubstr("too large for one model"));
}

TEST(OverlayModels, TakesModelsWithoutAnything) {
  ValidateModel(OverlayModels(Model(), Model()));
  ValidateModel(OverlayModels(Model(), SomeModel(true)));
}

}  // namespace
}  // namespace krot::internal
