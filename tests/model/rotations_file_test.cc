#include "krot/model/model_io.h"

#include <cmath>
#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/model/rigs.h"
#include "tests/model/tiny_model.h"
#include "tests/testing/model_matchers.h"

namespace krot::internal {
namespace {

using ::testing::HasSubstr;

std::string RotationsError(const std::string& text, Model model = TinyModel()) {
  return ModelErrorOf([&] { ReplaceRotations({"r.txt", text}, &model); });
}

const Eigen::Quaterniond kTurn =
    Eigen::Quaterniond(0.9, 0.1, -0.2, 0.3).normalized();

std::string Line(const std::string& name, const Eigen::Quaterniond& q) {
  std::ostringstream line;
  line.precision(17);
  line << name << " " << q.w() << " " << q.x() << " " << q.y() << " " << q.z()
       << "\n";
  return line.str();
}

TEST(RotationsFile, TurnsTheImagesThatItNamesAboutTheirCentres) {
  const Model before = TinyModel();
  Model after = before;
  const ReplacedRotations replaced = ReplaceRotations(
      {"r.txt", "# of a gimbal\n\n" + Line("left/a b.jpg", kTurn) +
                    Line("c.jpg", kTurn)},
      &after);
  EXPECT_EQ(replaced.num_frames, 2);
  EXPECT_EQ(replaced.num_kept_images, 1);
  ValidateModel(after);
  const auto was = ImageGeometries(before);
  const auto is = ImageGeometries(after);
  for (const int image : {0, 2}) {
    EXPECT_LT(
        (is[image].cam_from_world.rotation - kTurn.toRotationMatrix()).norm(),
        1e-15);
    const Eigen::Vector3d centre = Center(was[image].cam_from_world);
    EXPECT_LT((Center(is[image].cam_from_world) - centre).norm(),
              1e-14 * centre.norm());
    EXPECT_EQ(after.images[image].cam_from_world.quaternion_wxyz,
              after.frames[is[image].frame].rig_from_world.quaternion_wxyz);
  }
  EXPECT_EQ(is[1].rig_from_world.rotation, was[1].rig_from_world.rotation);
  EXPECT_EQ(after.images[1].cam_from_world.quaternion_wxyz,
            before.images[1].cam_from_world.quaternion_wxyz);
}

TEST(RotationsFile, TurnsAFrameThroughItsSensorsPlaceInTheRig) {
  Model model = TinyRigModel();
  const ReplacedRotations replaced =
      ReplaceRotations({"r.txt", Line("c.jpg", kTurn)}, &model);
  EXPECT_EQ(replaced.num_frames, 1);
  EXPECT_EQ(replaced.num_kept_images, 1);  // that of the other frame
  const auto geometries = ImageGeometries(model);
  for (const int image : {1, 2}) {  // "empty.png" is of the same sensor
    EXPECT_LT(
        (geometries[image].cam_from_world.rotation - kTurn.toRotationMatrix())
            .norm(),
        1e-15);
    EXPECT_LT((model.images[image].cam_from_world.Rotation() -
               kTurn.toRotationMatrix())
                  .norm(),
              1e-15);
  }
}

TEST(RotationsFile, OfTheModelsOwnRotationsChangesNoBit) {
  const Model before = TinyModel();
  Model after = before;
  ReplaceRotations(
      {"r.txt", "left/a b.jpg\t0.5 -0.5 0.5 -0.5 \r\nc.jpg +1 0 0 0"}, &after);
  EXPECT_THAT(after, IsModel(before));
}

TEST(RotationsFile, ThatCannotBeMeantIsRefusedWithItsLine) {
  EXPECT_THAT(
      RotationsError("c.jpg 1 0 0 0\nempty.png 1 0 0 0\nc.jpg 1 0 0 0\n"),
      HasSubstr("r.txt:3: found image \"c.jpg\" again, expected each "
                "once; line 1 names it"));
  EXPECT_THAT(RotationsError("c.jpg 0 0 0 0"),
              HasSubstr("r.txt:1: found a quaternion of zeros"));
  EXPECT_THAT(RotationsError("c.jpg 1 0 0 0 1 2 3"),
              HasSubstr("r.txt: found no image of the model in its 1 line, the "
                        "first has image \"c.jpg 1 0 0\""));
  EXPECT_THAT(RotationsError("c.jpg 1 0 nan 0"), HasSubstr("found \"nan\""));
  EXPECT_THAT(RotationsError("c.jpg 1 0 inf 0"), HasSubstr("found \"inf\""));
  EXPECT_THAT(RotationsError("c.jpg 1 0 0"), HasSubstr("found \"c.jpg\""));
  EXPECT_THAT(RotationsError("1 0 0 0"), HasSubstr("found no name"));
  EXPECT_THAT(RotationsError("0 0 0"), HasSubstr("found the end of the line"));
  EXPECT_THAT(RotationsError("# nothing\n"), HasSubstr("r.txt: found no line"));
}

TEST(RotationsFile, GivesAFrameWithoutARotationOneAndNoPlace) {
  Model model = TinyModel();
  model.images[2].cam_from_world = {{0, 0, 0, 0}, {0, 0, 0}};
  UseTrivialRigs(&model);
  ReplaceRotations({"r.txt", Line("c.jpg", kTurn)}, &model);
  const ImageGeometry image = ImageGeometries(model)[2];
  EXPECT_FALSE(image.has_pose);
  EXPECT_LT((image.cam_from_world.rotation - kTurn.toRotationMatrix()).norm(),
            1e-15);
  EXPECT_FALSE(image.cam_from_world.translation.allFinite());
}

TEST(RotationsFile, ThatContradictsItselfWithinAFrameIsRefused) {
  const Eigen::Quaterniond off(
      kTurn * Eigen::AngleAxisd(1e-4, Eigen::Vector3d::UnitX()));
  EXPECT_THAT(RotationsError(Line("c.jpg", kTurn) + Line("empty.png", off),
                             TinyRigModel()),
              HasSubstr("r.txt:2: found a rotation 0.000100 rad off the one "
                        "that line 1 gives to the same frame"));
  Model model = TinyRigModel();
  const ReplacedRotations replaced = ReplaceRotations(
      {"r.txt", Line("c.jpg", kTurn) + Line("empty.png", kTurn)}, &model);
  EXPECT_EQ(replaced.num_frames, 1);
}

TEST(RotationsFile, OfANameThatTwoImagesBearIsRefused) {
  Model model = TinyModel();
  model.images[1].name = "c.jpg";
  EXPECT_THAT(RotationsError("c.jpg 1 0 0 0", model),
              HasSubstr("which several images of the model bear"));
}

}  // namespace
}  // namespace krot::internal
