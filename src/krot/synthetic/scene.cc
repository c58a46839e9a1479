#include "krot/synthetic/scene.h"

#include <algorithm>
#include <string>
#include <utility>

#include "krot/model/trivial_rigs.h"
#include "krot/synthetic/default_camera.h"
#include "krot/synthetic/geometry.h"
#include "krot/synthetic/imaging.h"
#include "krot/synthetic/observations.h"
#include "krot/synthetic/start_noise.h"
#include "krot/synthetic/structure.h"
#include "krot/synthetic/trajectory.h"

namespace krot::internal {
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

// As COLMAP lays out the images of a rig: one folder per camera.
std::string ImageName(int frame, int sensor, int num_sensors) {
  constexpr size_t kDigits = 6;
  std::string number = std::to_string(frame + 1);
  if (number.size() < kDigits) number.insert(0, kDigits - number.size(), '0');
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

// Cameras, rigs, frames and images without poses and 2D points.
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
      image.camera_id = model.cameras[static_cast<size_t>(s)].id;
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

}  // namespace krot::internal
