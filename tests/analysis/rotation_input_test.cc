#include "krot/analysis/model_input.h"

#include <sstream>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using ::testing::HasSubstr;

Model RotatedScene() {
  SceneOptions options = SceneOf(8, 60, 6, 0.5);
  options.has_rigs = false;
  return SynthesizeScene(options).model;
}

FileBytes InverseRotations(const Model& model, size_t num_images = 8) {
  std::ostringstream lines;
  lines.precision(17);
  for (size_t n = 0; n < num_images; ++n) {
    const Image& image = model.images[n];
    const QuaternionWxyz& q = image.cam_from_world.quaternion_wxyz;
    lines << image.name << " " << q[0] << " " << -q[1] << " " << -q[2] << " "
          << -q[3] << "\n";
  }
  return {"r.txt", lines.str()};
}

TEST(TakeRotations, RefusesInverseOnesThatTheErrorsSpeakAgainst) {
  Model model = RotatedScene();
  const FileBytes file = InverseRotations(model);
  EXPECT_THAT(
      ModelErrorOf([&] { TakeRotations(file, &model); }),
      ::testing::AllOf(HasSubstr("r.txt: found rotations that are "),
                       HasSubstr("the median error is 0."),
                       HasSubstr(" with the model's own, with these ")));
}

// Most observations are of images that it does not name.
TEST(TakeRotations, RefusesInverseOnesOfAFewImages) {
  Model model = RotatedScene();
  const FileBytes file = InverseRotations(model, 3);
  EXPECT_THAT(ModelErrorOf([&] { TakeRotations(file, &model); }),
              HasSubstr("r.txt: found rotations that are "));
}

// The list is right, and the model's own rotations are the inverse ones.
TEST(TakeRotations, DoesNotRefuseWhereTheModelFitsNoBetter) {
  Model model = RotatedScene();
  const Model sound = model;
  for (Image& image : model.images) {
    QuaternionWxyz& q = image.cam_from_world.quaternion_wxyz;
    q = {q[0], -q[1], -q[2], -q[3]};
  }
  UseTrivialRigs(&model);
  const FileBytes file = InverseRotations(model);
  const RotationInput input = TakeRotations(file, &model);
  EXPECT_NE(input.replaced.mistake, "");
  for (size_t n = 0; n < sound.images.size(); ++n) {
    EXPECT_EQ(model.images[n].cam_from_world.quaternion_wxyz,
              sound.images[n].cam_from_world.quaternion_wxyz);
  }
}

TEST(TakeRotations, MeasuresWhatTheyDoToTheErrors) {
  Model model = RotatedScene();
  std::string lines;
  for (const Image& image : model.images) lines += image.name + " 1 0 0 0\n";
  const RotationInput input = TakeRotations({"r.txt", lines}, &model);
  EXPECT_EQ(input.replaced.mistake, "");
  ASSERT_TRUE(input.median_error_before);
  EXPECT_LT(*input.median_error_before, 1);
  EXPECT_TRUE(!input.median_error_after ||
              *input.median_error_after > 10 * *input.median_error_before);
}

}  // namespace
}  // namespace krot::internal
