#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"
#include "tests/cli/known_fixture.h"
#include "tests/cli/scenes.h"
#include "tests/testing/model_matchers.h"

// Rigs of three sensors: what is calibrated stays to the bit, and the same
// scene in other rigs has the same optimum.

namespace krot::internal {
namespace {

SceneOptions ThreeSensors() {
  SceneOptions options = SmallScene();
  options.num_frames = 8;
  options.num_points = 100;
  options.track_length = 8;
  options.sensors_per_rig = 3;
  options.rig_baseline = 0.1;
  return options;
}

class Rigs : public Known {
 protected:
  // Runs a command on a model and checks what has to hold of every result.
  Model Run(const Model& model, const Words& command) {
    ValidateModel(model);
    Save(model, folder_ / "input");
    Succeeded(
        RunKrot(command, {"--input_path", folder_ / "input", "--output_path",
                          folder_ / "output", "--overwrite", "1"}));
    return CheckedOutput(model);
  }

  // The certified solve of a model.
  Json Solve(const Model& model) {
    ValidateModel(model);
    Save(model, folder_ / "input");
    Succeeded(Known::Solve("input", "output", {"--overwrite", "1"}));
    CheckedOutput(model);
    Succeeded(Check("output", "output"));
    const Json report = Report("output");
    EXPECT_EQ(report["termination"], "gap_reached");
    return report;
  }

  // Two proofs of one optimum.
  static void ExpectSameOptimum(const Json& a, const Json& b) {
    EXPECT_EQ(a["num_observations"], b["num_observations"]);
    EXPECT_LE(a["lower_bound"], b["cost_final"]);
    EXPECT_LE(b["lower_bound"], a["cost_final"]);
    EXPECT_LE(a["relative_gap"], 1e-3);
    EXPECT_LE(b["relative_gap"], 1e-3);
  }

 private:
  Model CheckedOutput(const Model& before) const {
    const Model after = Load(folder_ / "output");
    EXPECT_THAT(after, HasRigsOf(before));
    ExpectImagesFollow(after);
    return after;
  }

  static void ExpectImagesFollow(const Model& model) {
    const std::vector<ImageGeometry> geometries = ImageGeometries(model);
    for (size_t n = 0; n < geometries.size(); ++n) {
      const RigidTransform own = model.images[n].cam_from_world.Transform();
      EXPECT_LT(
          (own.translation - geometries[n].cam_from_world.translation).norm(),
          1e-12);
      EXPECT_LT((own.rotation - geometries[n].cam_from_world.rotation).norm(),
                1e-12);
    }
  }
};

// The rig as another sensor, or another place, sees it.
Rig Rereferenced(const Rig& rig, const SensorId& reference,
                 const RigidTransform& new_from_old) {
  Rig result;
  result.id = rig.id;
  result.ref_sensor_id = reference;
  const auto add = [&](const SensorId& id, const RigidTransform& from_old) {
    if (id == reference) return;
    result.sensors.push_back({id, ToPose(from_old * Inverse(new_from_old))});
  };
  add(*rig.ref_sensor_id, {});
  for (const RigSensor& sensor : rig.sensors) {
    add(sensor.sensor_id, sensor.sensor_from_rig->Transform());
  }
  return result;
}

// Without the observations of some images.
Model Blind(const Model& model, const std::set<ImageId>& images) {
  std::vector<char> marks;
  for (const TrackElement& element : model.track_elements) {
    marks.push_back(images.count(element.image_id) > 0);
  }
  return RemoveObservations(model, marks).model;
}

// Without the images themselves.
Model Without(const Model& model, const std::set<ImageId>& images) {
  Model result = Blind(model, images);
  const auto is_gone = [&](uint64_t id) {
    return images.count(static_cast<ImageId>(id)) > 0;
  };
  result.images.erase(
      std::remove_if(result.images.begin(), result.images.end(),
                     [&](const Image& image) { return is_gone(image.id); }),
      result.images.end());
  for (Frame& frame : result.frames) {
    frame.data.erase(std::remove_if(frame.data.begin(), frame.data.end(),
                                    [&](const FrameData& data) {
                                      return is_gone(data.data_id);
                                    }),
                     frame.data.end());
  }
  return result;
}

const RigidTransform kLever{
    Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized())
        .toRotationMatrix(),
    {0.3, -0.2, 0.1}};

TEST_F(Rigs, StayToTheBitThroughEveryCommand) {
  const Model model = SynthesizeScene(ThreeSensors()).model;
  for (const Words& command : std::vector<Words>{
           {"solver"},
           {"solver", "--Solver.method", "res_int"},
           {"solver", "--Solver.init", "feasible"},
           {"solver", "--Solver.polish", "rotations_fixed"},
           {"point_triangulator"},
           {"outlier_filter", "--OutlierFilter.max_error", "1.5"},
           {"bundle_adjuster", "--BundleAdjustment.refine_sensor_from_rig",
            "0"},
           {"bundle_adjuster", "--BundleAdjustment.refine_sensor_from_rig", "0",
            "--BundleAdjustment.max_error_factor", "1.1"}}) {
    SCOPED_TRACE(::testing::PrintToString(command));
    Run(model, command);
  }
}

TEST_F(Rigs, WhoseImagesStandElsewhereAreWarnedOf) {
  Model model = SynthesizeScene(ThreeSensors()).model;
  Save(model, folder_ / "sound");
  const Eigen::Quaterniond turn(
      Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitY()));
  for (size_t n = 0; n < 5; ++n) {
    Pose& pose = model.images[n].cam_from_world;
    pose.quaternion_wxyz =
        ToWxyz(turn * NormalizedQuaternion(pose.quaternion_wxyz));
  }
  Save(model, folder_ / "stale");
  EXPECT_EQ(RunKrot({"model_analyzer", "--path", folder_ / "sound"}).err, "");
  const KrotResult result =
      Succeeded(RunKrot({"model_analyzer", "--path", folder_ / "stale"}));
  EXPECT_THAT(result.err,
              HasSubstr("the poses of 5 of 24 images are not those that "
                        "rigs and frames give them, rotations are off by "
                        "11.46 degrees in the median and 11.46 at most"));
}

TEST_F(Rigs, OfAnImuHaveTheOptimumOfTheSameRigOfACamera) {
  const Model model = SynthesizeScene(ThreeSensors()).model;
  Model imu = model;
  const SensorId reference{kSensorTypeImu, 1};
  imu.rigs[0] = Rereferenced(model.rigs[0], reference, kLever);
  for (Frame& frame : imu.frames) {
    frame.rig_from_world = ToPose(kLever * frame.rig_from_world.Transform());
    frame.data.push_back({reference, frame.id});
  }
  ExpectSameOptimum(Solve(model), Solve(imu));
}

TEST_F(Rigs, OfTwoKindsHaveTheOptimumOfTheOneThatTheyAre) {
  const Model model = SynthesizeScene(ThreeSensors()).model;
  constexpr CameraId kSecond = 100;
  Model two = model;
  for (Camera camera : model.cameras) {
    camera.id += kSecond;
    two.cameras.push_back(camera);
  }
  // The second rig is the first one, of other cameras, as its last one sees it.
  Rig second = model.rigs[0];
  second.id = 7;
  second.ref_sensor_id->id += kSecond;
  for (RigSensor& sensor : second.sensors) sensor.sensor_id.id += kSecond;
  const RigSensor last = second.sensors.back();
  const RigidTransform last_from_first = last.sensor_from_rig->Transform();
  two.rigs.push_back(Rereferenced(second, last.sensor_id, last_from_first));
  std::set<ImageId> images;
  for (size_t f = 0; f < two.frames.size(); f += 2) {
    Frame& frame = two.frames[f];
    frame.rig_id = 7;
    frame.rig_from_world =
        ToPose(last_from_first * frame.rig_from_world.Transform());
    for (FrameData& data : frame.data) {
      data.sensor_id.id += kSecond;
      images.insert(static_cast<ImageId>(data.data_id));
    }
  }
  for (Image& image : two.images) {
    if (images.count(image.id) > 0) image.camera_id += kSecond;
  }
  ExpectSameOptimum(Solve(model), Solve(two));
}

TEST_F(Rigs, OfWhichImagesAreMissingHaveTheOptimumOfImagesThatSeeNothing) {
  const Model model = SynthesizeScene(ThreeSensors()).model;
  std::set<ImageId> missing;
  for (size_t f = 0; f < model.frames.size(); f += 3) {
    const std::vector<FrameData>& data = model.frames[f].data;
    missing.insert(static_cast<ImageId>(data[f % data.size()].data_id));
  }
  ExpectSameOptimum(Solve(Blind(model, missing)),
                    Solve(Without(model, missing)));
}

TEST_F(Rigs, OfASensorThatSeesNothingAreSolvedByTheOthers) {
  const Model model = SynthesizeScene(ThreeSensors()).model;
  std::set<ImageId> blind;
  for (const Frame& frame : model.frames) {
    blind.insert(static_cast<ImageId>(frame.data.back().data_id));
  }
  EXPECT_EQ(Solve(Blind(model, blind))["num_images"], model.images.size());
}

// The distance of the outermost frames, against the truth.
double ScaleError(const Model& model, const Model& truth) {
  const auto length = [](const Model& m) {
    const auto centre = [](const Frame& frame) {
      return Center(frame.rig_from_world.Transform());
    };
    double largest = 0;
    for (const Frame& frame : m.frames) {
      largest =
          std::max(largest, (centre(frame) - centre(m.frames.front())).norm());
    }
    return largest;
  };
  return std::abs(length(model) / length(truth) - 1);
}

TEST_F(Rigs, SetTheScaleUpToTheNoise) {
  for (const SceneLayout layout : {SceneLayout::kOrbit, SceneLayout::kStreet}) {
    SceneOptions options = ThreeSensors();
    options.layout = layout;
    options.num_frames = 60;
    options.num_points = 600;
    options.pixel_noise = 1;
    const SyntheticScene scene = SynthesizeScene(options);
    Solve(scene.model);
    // Of one point of one frame, at a depth of one and with a focal length of
    // 1024 pixels, it is 1 / 102.
    EXPECT_LT(ScaleError(Load(folder_ / "output"), scene.ground_truth), 0.01);
  }
}

TEST_F(Rigs, OfBaselinesOfNextToNothingEndWithACertificate) {
  SceneOptions options = ThreeSensors();
  options.rig_baseline = 1.0 / 6000;
  Solve(SynthesizeScene(options).model);
}

}  // namespace
}  // namespace krot::internal
