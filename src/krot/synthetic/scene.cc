#include "krot/synthetic/scene.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "krot/base/check.h"
#include "krot/camera/camera_model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

template <typename Value>
void CheckRange(const char* name, Value value, Value low, Value high) {
  const bool ok = value >= low && value <= high;  // false for NaN
  std::ostringstream range;
  range << "in [" << low << ", " << high << "]";
  CheckArgument(ok, name, value, range.str());
}

}  // namespace

void Check(const SceneOptions& options) {
  CheckRange("num_frames", options.num_frames, 2, 10'000'000);
  CheckRange("num_points", options.num_points, 1, 1'000'000'000);
  const CameraModelInfo* camera = FindCameraModel(options.camera_model_id);
  CheckArgument(camera != nullptr, "camera_model_id", options.camera_model_id,
                "the id of a camera model, 0 to 17");
  CheckRange("image_width", options.image_width, 64, 65536);
  CheckRange("image_height", options.image_height, 64, 65536);
  CheckRange("focal_length_factor", options.focal_length_factor, 0.5, 10.0);

  CheckRange("sensors_per_rig", options.sensors_per_rig, 1, 16);
  CheckArgument(options.has_rigs || options.sensors_per_rig == 1,
                "sensors_per_rig", options.sensors_per_rig,
                "1 in a model without rigs (has_rigs = 0)");
  CheckRange("rig_baseline", options.rig_baseline, 0.0, 0.2);
  CheckRange("rig_rotation_deg", options.rig_rotation_deg, 0.0, 180.0);
  const double num_images =
      static_cast<double>(options.num_frames) * options.sensors_per_rig;
  CheckRange("track_length", options.track_length, 2.0, num_images);

  CheckRange("pixel_noise", options.pixel_noise, 0.0, 10.0);
  CheckRange("outlier_ratio", options.outlier_ratio, 0.0, 0.9);
  CheckRange("duplicate_ratio", options.duplicate_ratio, 0.0, 1.0);
  CheckRange("start_translation_noise", options.start_translation_noise, 0.0,
             1.0);
  CheckRange("start_point_noise", options.start_point_noise, 0.0, 1.0);
  CheckRange("rotation_noise_deg", options.rotation_noise_deg, 0.0, 3.0);
}

namespace {

// Default values of the parameters after the principal point, by COLMAP's model
// id.
const std::vector<double>& DefaultDistortion(int model_id) {
  static const std::vector<std::vector<double>> kDistortions = {
      {},                               // SIMPLE_PINHOLE
      {},                               // PINHOLE
      {-0.03},                          // SIMPLE_RADIAL
      {-0.03, 0.004},                   // RADIAL
      {-0.03, 0.004, 1e-3, -5e-4},      // OPENCV
      {-0.02, 4e-3, -5e-4, 5e-5},       // OPENCV_FISHEYE
      {-0.03, 0.004, 1e-3, -5e-4,       // FULL_OPENCV
       1e-3, 0.01, -2e-3, 5e-4},        //
      {0.5},                            // FOV
      {-0.02},                          // SIMPLE_RADIAL_FISHEYE
      {-0.02, 4e-3},                    // RADIAL_FISHEYE
      {-0.02, 4e-3, 1e-3, -5e-4,        // THIN_PRISM_FISHEYE
       -5e-4, 5e-5, 1e-3, -1e-3},       //
      {-0.02, 4e-3, -5e-4, 5e-5, 0, 0,  // RAD_TAN_THIN_PRISM_FISHEYE
       1e-3, -5e-4, 1e-3, -5e-4, -1e-3, 5e-4},
      {-0.05},      // SIMPLE_DIVISION
      {-0.05},      // DIVISION
      {},           // SIMPLE_FISHEYE
      {},           // FISHEYE
      {0.6, 1.05},  // EUCM
  };
  return kDistortions.at(static_cast<size_t>(model_id));
}

}  // namespace

Camera DefaultCamera(int model_id, uint64_t width, uint64_t height,
                     double focal_length) {
  const CameraModelInfo* info = FindCameraModel(model_id);
  CheckArgument(info != nullptr, "camera_model_id", model_id,
                "the id of a camera model");
  Camera camera;
  camera.model_id = model_id;
  camera.width = width;
  camera.height = height;
  if (!info->has_image_plane) {
    camera.params = {static_cast<double>(width), static_cast<double>(height)};
    return camera;
  }
  camera.params = {focal_length};
  if (info->num_focal_lengths() == 2) {
    camera.params.push_back(1.01 * focal_length);
  }
  camera.params.push_back(static_cast<double>(width) / 2);
  camera.params.push_back(static_cast<double>(height) / 2);
  const std::vector<double>& distortion = DefaultDistortion(model_id);
  camera.params.insert(camera.params.end(), distortion.begin(),
                       distortion.end());
  return camera;
}

namespace {

Camera SceneCamera(const SceneOptions& options) {
  const double focal_length =
      options.focal_length_factor *
      std::max(options.image_width, options.image_height);
  return DefaultCamera(
      options.camera_model_id, static_cast<uint64_t>(options.image_width),
      static_cast<uint64_t>(options.image_height), focal_length);
}

SensorId CameraSensor(int sensor) {
  return {kSensorTypeCamera, static_cast<uint32_t>(sensor + 1)};
}

ImageId ImageIdOf(int frame, int sensor, int num_sensors) {
  return static_cast<ImageId>(frame * num_sensors + sensor + 1);
}

// The name as COLMAP expects for rigs: one folder per camera.
std::string ImageName(int frame, int sensor, int num_sensors) {
  std::string number = std::to_string(frame + 1);
  while (number.size() < 6) number.insert(0, "0");
  std::string name = "frame" + number + ".jpg";
  if (num_sensors == 1) return name;
  return "camera" + std::to_string(sensor + 1) + "/" + name;
}

Rig MakeRig(const SceneGeometry& geometry) {
  Rig rig;
  rig.id = 1;
  rig.ref_sensor_id = CameraSensor(0);
  for (size_t s = 1; s < geometry.sensor_from_rig.size(); ++s) {
    rig.sensors.push_back(
        {CameraSensor(static_cast<int>(s)), geometry.sensor_from_rig[s]});
  }
  return rig;
}

// Cameras, rigs, frames and images, but no poses and 2D points.
Model MakeSkeleton(const SceneOptions& options, const SceneGeometry& geometry) {
  const int num_sensors = options.sensors_per_rig;
  Model model;
  for (int s = 0; s < num_sensors; ++s) {
    model.cameras.push_back(SceneCamera(options));
    model.cameras.back().id = static_cast<CameraId>(s + 1);
  }
  for (int f = 0; f < options.num_frames; ++f) {
    for (int s = 0; s < num_sensors; ++s) {
      Image image;
      image.id = ImageIdOf(f, s, num_sensors);
      image.camera_id = model.cameras[s].id;
      image.name = ImageName(f, s, num_sensors);
      model.images.push_back(std::move(image));
    }
  }
  model.stores_rigs = options.has_rigs;
  model.rigs = {MakeRig(geometry)};
  for (int f = 0; f < options.num_frames; ++f) {
    Frame frame;
    frame.id = static_cast<FrameId>(f + 1);
    frame.rig_id = model.rigs.front().id;
    for (int s = 0; s < num_sensors; ++s) {
      frame.data.push_back({CameraSensor(s), ImageIdOf(f, s, num_sensors)});
    }
    model.frames.push_back(std::move(frame));
  }
  return model;
}

void SetGeometry(const SceneGeometry& geometry, Model* model) {
  for (size_t f = 0; f < model->frames.size(); ++f) {
    model->frames[f].rig_from_world = geometry.rig_from_world[f];
  }
  const std::vector<Pose> cam_from_world = CamFromWorld(geometry);
  for (size_t j = 0; j < model->images.size(); ++j) {
    model->images[j].cam_from_world = cam_from_world[j];
  }
  for (size_t k = 0; k < model->points3D.size(); ++k) {
    model->points3D[k].xyz = geometry.points[k];
  }
  if (!model->stores_rigs) UseTrivialRigs(model);
}

}  // namespace

SyntheticScene SynthesizeScene(const SceneOptions& options) {
  Check(options);
  Random random(options.random_seed);
  const Trajectory trajectory = MakeTrajectory(options, &random);
  SceneGeometry truth;
  truth.rig_from_world = trajectory.rig_from_world;
  truth.sensor_from_rig = MakeRigSensors(options);
  const Imaging imaging(SceneCamera(options), ObservationMargin(options),
                        CamFromWorld(truth));
  const Structure structure =
      SampleStructure(options, trajectory, imaging, &random);
  truth.points = structure.points;

  SyntheticScene scene;
  scene.ground_truth = MakeSkeleton(options, truth);
  scene.outliers =
      WriteObservations(structure, options, &random, &scene.ground_truth);
  SetGeometry(truth, &scene.ground_truth);
  scene.model = scene.ground_truth;
  SetGeometry(PerturbStart(truth, structure, options, &random), &scene.model);
  return scene;
}

Database DatabaseOf(const Model& model) {
  Database database;
  database.num_images = static_cast<int64_t>(model.images.size());
  std::map<Point3DId, std::vector<std::array<uint32_t, 2>>> seen;
  for (uint32_t i = 0; i < model.images.size(); ++i) {
    database.keypoints.emplace_back();
    database.scales.emplace_back(model.images[i].points2D.size(), 1.0F);
    const auto& points2D = model.images[i].points2D;
    for (uint32_t k = 0; k < points2D.size(); ++k) {
      database.keypoints[i].emplace_back(points2D[k].x, points2D[k].y);
      if (points2D[k].point3D_id == kInvalidPoint3DId) continue;
      seen[points2D[k].point3D_id].push_back({i, k});
    }
  }
  std::map<std::pair<int32_t, int32_t>, VerifiedPair> pairs;
  for (const auto& [id, track] : seen) {
    for (const auto& a : track) {
      for (const auto& b : track) {
        if (a[0] >= b[0]) continue;
        VerifiedPair& pair = pairs[{a[0], b[0]}];
        pair.image1 = static_cast<int32_t>(a[0]);
        pair.image2 = static_cast<int32_t>(b[0]);
        pair.config = 2;
        pair.matches.push_back({a[1], b[1]});
      }
    }
  }
  for (const auto& [images, pair] : pairs) database.pairs.push_back(pair);
  return database;
}

}  // namespace krot::internal
