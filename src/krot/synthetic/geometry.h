#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/model.h"

namespace krot::internal {

// Where everything in a scene is: what a solver estimates, and what it keeps.
struct SceneGeometry {
  std::vector<Pose> rig_from_world;   // per frame
  std::vector<Pose> sensor_from_rig;  // the reference sensor first
  std::vector<Eigen::Vector3d> points;
};

// cam_from_world of every image: sensor s of frame f is the image
// f num_sensors + s.
std::vector<Pose> CamFromWorld(const SceneGeometry& geometry);

}  // namespace krot::internal
