#include <functional>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/synthetic/scene.h"

namespace krot::internal {
namespace {

using testing::StartsWith;

struct BadOption {
  std::string message_start;
  std::function<void(SceneOptions*)> set;
};

TEST(SceneOptions, AreValidByDefault) { EXPECT_NO_THROW(Check({})); }

TEST(SceneOptions, OutOfRangeAreNamedWithTheirValue) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<BadOption> bad_options = {
      {"num_frames = 1, ", [](auto* o) { o->num_frames = 1; }},
      {"num_points = 0, ", [](auto* o) { o->num_points = 0; }},
      {"track_length = 1.5, ", [](auto* o) { o->track_length = 1.5; }},
      {"track_length = 21, ", [](auto* o) { o->track_length = 21; }},
      {"track_length = nan, ", [=](auto* o) { o->track_length = nan; }},
      {"camera_model_id = 18, ", [](auto* o) { o->camera_model_id = 18; }},
      {"camera_model_id = -1, ", [](auto* o) { o->camera_model_id = -1; }},
      {"image_width = 10, ", [](auto* o) { o->image_width = 10; }},
      {"image_height = 99999, ", [](auto* o) { o->image_height = 99999; }},
      {"focal_length_factor = 0.1, ",
       [](auto* o) { o->focal_length_factor = 0.1; }},
      {"sensors_per_rig = 0, ", [](auto* o) { o->sensors_per_rig = 0; }},
      {"rig_baseline = -1, ", [](auto* o) { o->rig_baseline = -1; }},
      {"rig_rotation_deg = 181, ", [](auto* o) { o->rig_rotation_deg = 181; }},
      {"pixel_noise = -0.5, ", [](auto* o) { o->pixel_noise = -0.5; }},
      {"outlier_ratio = 1, ", [](auto* o) { o->outlier_ratio = 1; }},
      {"duplicate_ratio = 2, ", [](auto* o) { o->duplicate_ratio = 2; }},
      {"start_translation_noise = -1, ",
       [](auto* o) { o->start_translation_noise = -1; }},
      {"start_point_noise = 3, ", [](auto* o) { o->start_point_noise = 3; }},
      {"rotation_noise_deg = 4, ", [](auto* o) { o->rotation_noise_deg = 4; }},
  };
  for (const BadOption& bad : bad_options) {
    SceneOptions options;
    bad.set(&options);
    try {
      SynthesizeScene(options);
      ADD_FAILURE() << bad.message_start << "was accepted";
    } catch (const std::invalid_argument& error) {
      EXPECT_THAT(error.what(), StartsWith(bad.message_start));
    }
  }
}

TEST(SceneOptions, RefuseSeveralSensorsInALegacyModel) {
  SceneOptions options;
  options.has_rigs = false;
  EXPECT_NO_THROW(Check(options));
  options.sensors_per_rig = 2;
  EXPECT_THROW(Check(options), std::invalid_argument);
}

TEST(SceneOptions, RefuseSensorsThatShareNoPoints) {
  SceneOptions options;
  options.num_frames = 2;
  options.track_length = 2;
  options.sensors_per_rig = 2;
  options.rig_rotation_deg = 90;
  options.focal_length_factor = 10;
  EXPECT_THROW(SynthesizeScene(options), std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
