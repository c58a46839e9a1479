#include "krot/synthetic/geometry.h"

#include "krot/synthetic/rigid_motion.h"

namespace krot::internal {

std::vector<Pose> CamFromWorld(const SceneGeometry& geometry) {
  std::vector<Pose> cam_from_world;
  cam_from_world.reserve(geometry.rig_from_world.size() *
                         geometry.sensor_from_rig.size());
  for (const Pose& rig_from_world : geometry.rig_from_world) {
    for (const Pose& sensor_from_rig : geometry.sensor_from_rig) {
      cam_from_world.push_back(
          UnitPose(sensor_from_rig.Transform() * rig_from_world.Transform()));
    }
  }
  return cam_from_world;
}

}  // namespace krot::internal
