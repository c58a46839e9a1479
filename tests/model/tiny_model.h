#pragma once

#include <cmath>
#include <limits>

#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {

// A valid legacy model, small enough to be broken at every byte: two cameras,
// three images (one of them empty), three points. Awkward where files may be:
// sparse ids, records out of order, an unused camera, a repeated image in a
// track, numbers that need 17 digits, a NaN translation, a name with a blank.
inline Model TinyModel() {
  Model model;
  model.cameras = {{7, 2, 640, 480, {500.1, 320, 240, -0.1}},
                   {3, 1, 800, 600, {1.0 / 3, 5e-324, -0.0, 1e99}}};

  Image first;
  first.id = 4000000000;
  first.cam_from_world = {{0.5, -0.5, 0.5, -0.5}, {0.1, 0.2, 0.3}};
  first.camera_id = 7;
  first.name = "left/a b.jpg";
  first.points2D = {{10.5, 20.25, 12},
                    {1e-7, 3, kInvalidPoint3DId},
                    {0.1, 0.7, 5000000000},
                    {11, 21, 12}};
  Image empty;
  empty.id = 2;
  empty.cam_from_world.translation.setConstant(
      std::numeric_limits<double>::quiet_NaN());
  empty.camera_id = 7;
  empty.name = "empty.png";
  Image last;
  last.id = 9;
  last.cam_from_world = {{2, 0, 0, 0}, {-1, 1e10, 2.0 / 3}};
  last.camera_id = 7;
  last.name = "c.jpg";
  last.points2D = {{5, 6, 5000000000}, {7, 8, 12}};
  model.images = {first, empty, last};

  model.points3D.resize(3);
  model.points3D[0] = {5000000000, {1, 2, 3}, {255, 0, 9}, 0.25, 0, 2};
  model.points3D[1] = {1, {-1e-20, 0.1, 4}, {1, 2, 3}, -1, 2, 2};
  model.points3D[2] = {12, {4, 5, std::sqrt(2)}, {0, 0, 0}, 1e-9, 2, 5};
  model.track_elements = {
      {9, 0}, {4000000000, 2}, {9, 1}, {4000000000, 0}, {4000000000, 3}};
  UseTrivialRigs(&model);
  return model;
}

// The same with rigs and frames: a rig of an IMU as reference, a camera with
// a pose and one without; a rig without sensors; a frame without data.
inline Model TinyRigModel() {
  Model model = TinyModel();
  model.stores_rigs = true;
  Rig rig;
  rig.id = 5;
  rig.ref_sensor_id = SensorId{kSensorTypeImu, 1};
  rig.sensors = {{{kSensorTypeCamera, 7}, Pose{{1, 0.1, 0, 0}, {0, 0.3, 0}}},
                 {{kSensorTypeCamera, 3}, std::nullopt}};
  Rig empty_rig;
  empty_rig.id = 1;
  model.rigs = {rig, empty_rig};

  Frame frame;
  frame.id = 11;
  frame.rig_id = 5;
  frame.rig_from_world = {{0.1, 0.2, 0.3, 0.4}, {1, 2, 1.0 / 7}};
  frame.data = {{{kSensorTypeImu, 1}, uint64_t{1} << 40},
                {{kSensorTypeCamera, 7}, 9},
                {{kSensorTypeCamera, 7}, 2}};
  Frame second = frame;
  second.id = 10;
  second.data = {{{kSensorTypeCamera, 7}, 4000000000}};
  Frame without_data = frame;
  without_data.id = 12;
  without_data.data.clear();
  model.frames = {frame, second, without_data};
  return model;
}

}  // namespace krot::internal
