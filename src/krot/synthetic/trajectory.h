#pragma once

#include <vector>

#include "krot/model.h"
#include "krot/synthetic/random.h"
#include "krot/synthetic/scene.h"

namespace krot::internal {

// Where the frames of a scene stand, and how far they look.
struct Trajectory {
  std::vector<Pose> rig_from_world;
  // Depths of the points in the frame that they are sampled from.
  double min_depth = 0;
  double max_depth = 0;
  // A point sampled from frame f may be seen by frame f + offset, for these
  // offsets; modulo the number of frames if the trajectory is closed.
  std::vector<int> neighbor_offsets;
  bool is_closed = false;
};

// Frames in the order of the path. Requires checked options. O(num_frames).
Trajectory MakeTrajectory(const SceneOptions& options, Random* random);

// sensor_from_rig of every sensor: the reference sensor (the identity) first,
// the others on a circle around it, turned alternately to the right and to
// the left.
std::vector<Pose> MakeRigSensors(const SceneOptions& options);

}  // namespace krot::internal
