#include "krot/synthetic/scene.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <numeric>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/camera/camera_model.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "tests/synthetic/scene_geometry.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

// Number of sets that the frames fall into when those that share a point are
// joined.
int NumComponents(const Model& model, int sensors_per_rig) {
  std::vector<size_t> parent(model.images.size() / sensors_per_rig);
  std::iota(parent.begin(), parent.end(), size_t{0});
  const auto root = [&parent](size_t f) {
    while (parent[f] != f) f = parent[f] = parent[parent[f]];
    return f;
  };
  for (const Point3D& point : model.points3D) {
    const auto frame = [&](uint64_t n) {
      return (model.track_elements[n].image_id - 1) / sensors_per_rig;
    };
    for (uint64_t n = point.track_begin + 1; n < point.track_end; ++n) {
      parent[root(frame(n))] = root(frame(point.track_begin));
    }
  }
  std::set<size_t> roots;
  for (size_t f = 0; f < parent.size(); ++f) roots.insert(root(f));
  return static_cast<int>(roots.size());
}

// The largest difference of frame numbers within one track.
int MaxTrackSpan(const Model& model) {
  int span = 0;
  for (const Point3D& point : model.points3D) {
    int first = std::numeric_limits<int>::max();
    int last = 0;
    for (uint64_t n = point.track_begin; n < point.track_end; ++n) {
      const int frame = static_cast<int>(model.track_elements[n].image_id);
      first = std::min(first, frame);
      last = std::max(last, frame);
    }
    span = std::max(span, last - first);
  }
  return span;
}

class SceneOfCamera : public testing::TestWithParam<int> {};

TEST_P(SceneOfCamera, IsValidAndItsTruthReproducesEveryPixel) {
  for (const SceneLayout layout : {SceneLayout::kOrbit, SceneLayout::kStreet}) {
    SceneOptions options;
    options.layout = layout;
    options.camera_model_id = GetParam();
    options.num_points = 200;
    const SyntheticScene scene = SynthesizeScene(options);
    EXPECT_NO_THROW(ValidateModel(scene.model));
    EXPECT_NO_THROW(ValidateModel(scene.ground_truth));
    EXPECT_LT(MaxErrorPx(scene.ground_truth), 1e-9);
    EXPECT_GT(MinDepth(scene.ground_truth), 0.1);
    EXPECT_LT(MaxErrorPx(scene.model), 1e-9) << "no noise was asked for";
  }
}

TEST_P(SceneOfCamera, HasAllPixelsInsideItsImagesAndUndistortable) {
  SceneOptions options;
  options.camera_model_id = GetParam();
  options.focal_length_factor = 0.5;
  options.num_points = 200;
  const SyntheticScene scene = SynthesizeScene(options);
  const Camera& camera = scene.model.cameras.front();
  for (const SceneObservation& o : RecomputeObservations(scene.model)) {
    EXPECT_GE(o.measured.minCoeff(), 0);
    EXPECT_LE(o.measured.x(), options.image_width);
    EXPECT_LE(o.measured.y(), options.image_height);
    EXPECT_TRUE(UndistortPixel(camera, o.measured));
  }
}

INSTANTIATE_TEST_SUITE_P(All, SceneOfCamera, testing::Range(0, 17));

TEST(SceneOfPanoramas, LooksInAllDirectionsAndItsTruthReproducesEveryPixel) {
  SceneOptions options;
  options.camera_model_id = 17;
  options.start_translation_noise = 0.5;
  options.start_point_noise = 0.5;
  for (const SceneLayout layout : {SceneLayout::kOrbit, SceneLayout::kStreet}) {
    options.layout = layout;
    const SyntheticScene scene = SynthesizeScene(options);
    EXPECT_NO_THROW(ValidateModel(scene.model));
    int num_behind = 0;
    for (const SceneObservation& o :
         RecomputeObservations(scene.ground_truth)) {
      EXPECT_LT(o.ErrorPx(), 1e-9);
      num_behind += o.depth < 0;
    }
    EXPECT_GT(num_behind, 100);
  }
}

TEST(Scene, HasTheNumbersOfFramesImagesAndPointsAskedFor) {
  SceneOptions options = SceneOf(12, 321);
  options.sensors_per_rig = 3;
  const Model model = SynthesizeScene(options).model;
  EXPECT_EQ(model.frames.size(), 12u);
  EXPECT_EQ(model.images.size(), 36u);
  EXPECT_EQ(model.cameras.size(), 3u);
  EXPECT_EQ(model.rigs.size(), 1u);
  EXPECT_EQ(model.points3D.size(), 321u);
}

TEST(Scene, HasTracksOfTheMeanLengthAskedForAndNoneBelowTwo) {
  for (const SceneLayout layout : {SceneLayout::kOrbit, SceneLayout::kStreet}) {
    for (const double track_length : {2.0, 3.5, 10.0, 20.0}) {
      SceneOptions options = SceneOf(100, 2000, track_length);
      options.layout = layout;
      const Model model = SynthesizeScene(options).ground_truth;
      const double mean = static_cast<double>(model.track_elements.size()) /
                          static_cast<double>(model.points3D.size());
      EXPECT_NEAR(mean, track_length, 0.1 * track_length);
      for (const Point3D& point : model.points3D) {
        EXPECT_GE(point.track_end - point.track_begin, 2u);
      }
    }
  }
}

TEST(Scene, OfAStreetIsConnectedThroughNeighbouringFramesOnly) {
  SceneOptions options = SceneOf(1000, 20000);
  options.layout = SceneLayout::kStreet;
  const Model model = SynthesizeScene(options).model;
  EXPECT_EQ(NumComponents(model, 1), 1);
  EXPECT_LE(MaxTrackSpan(model), 4 * 6);
}

TEST(Scene, OfAnOrbitIsConnected) {
  SceneOptions options;
  options.sensors_per_rig = 2;
  EXPECT_EQ(NumComponents(SynthesizeScene(options).model, 2), 1);
}

TEST(Scene, GivesEveryImagePoints) {
  SceneOptions options;
  options.layout = SceneLayout::kStreet;
  options.sensors_per_rig = 4;
  options.rig_rotation_deg = 90;
  options.num_points = 800;
  for (const Image& image : SynthesizeScene(options).model.images) {
    EXPECT_GE(image.points2D.size(), 10u) << image.name;
  }
}

TEST(Scene, OfALegacyModelHasTrivialRigsThatAreNotStored) {
  SceneOptions options;
  options.has_rigs = false;
  const SyntheticScene scene = SynthesizeScene(options);
  EXPECT_FALSE(scene.model.stores_rigs);
  Model trivial = scene.model;
  UseTrivialRigs(&trivial);
  EXPECT_THAT(scene.model, IsModel(trivial));
  EXPECT_NO_THROW(ValidateModel(scene.model));
  EXPECT_LT(MaxErrorPx(scene.ground_truth), 1e-9);
}

TEST(Scene, OfARigKeepsSensorPosesAndImagePosesConsistent) {
  SceneOptions options;
  options.sensors_per_rig = 3;
  options.rig_baseline = 0.1;
  options.rig_rotation_deg = 15;
  options.start_translation_noise = 0.05;
  options.rotation_noise_deg = 0.5;
  const Model model = SynthesizeScene(options).model;
  for (size_t j = 0; j < model.images.size(); ++j) {
    const Frame& frame = model.frames[j / 3];
    const Pose& rig_from_world = frame.rig_from_world;
    const Pose sensor_from_rig =
        j % 3 == 0 ? Pose() : *model.rigs[0].sensors[j % 3 - 1].sensor_from_rig;
    const Eigen::Matrix3d R_sr = sensor_from_rig.Rotation();
    const Pose& cam_from_world = model.images[j].cam_from_world;
    EXPECT_LT((cam_from_world.Rotation() - R_sr * rig_from_world.Rotation())
                  .cwiseAbs()
                  .maxCoeff(),
              1e-14);
    EXPECT_LT((cam_from_world.translation - R_sr * rig_from_world.translation -
               sensor_from_rig.translation)
                  .norm(),
              1e-14);
    EXPECT_EQ(frame.data[j % 3].data_id, model.images[j].id);
  }
}

TEST(Scene, OfARigHasTheBaselineAndTheAngleAskedFor) {
  SceneOptions options;
  options.sensors_per_rig = 2;
  options.rig_baseline = 0.15;
  options.rig_rotation_deg = 20;
  const Rig rig = SynthesizeScene(options).model.rigs.front();
  ASSERT_EQ(rig.sensors.size(), 1u);
  const Pose& pose = *rig.sensors.front().sensor_from_rig;
  EXPECT_NEAR(pose.translation.norm(), 0.15, 1e-14);
  const double angle = Eigen::AngleAxisd(pose.Rotation()).angle();
  EXPECT_NEAR(angle, 20 * 3.14159265358979323846 / 180, 1e-14);

  options.rig_baseline = 0;
  const Rig no_baseline = SynthesizeScene(options).model.rigs.front();
  EXPECT_EQ(no_baseline.sensors.front().sensor_from_rig->translation.norm(), 0);
}

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
