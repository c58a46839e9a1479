#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/synthetic/imaging.h"
#include "krot/synthetic/random.h"
#include "krot/synthetic/scene.h"
#include "krot/synthetic/trajectory.h"

namespace krot::internal {

// One point in one image.
struct Sighting {
  int32_t image = 0;
  Eigen::Vector2d pixel;  // exact
};

// The points of a scene and the images that see them.
struct Structure {
  std::vector<Eigen::Vector3d> points;
  // Point k is seen in sightings[point_begin[k], point_begin[k + 1]).
  std::vector<int64_t> point_begin = {0};
  std::vector<Sighting> sightings;
};

// Samples points by back-projection, an equal number from every image, and
// looks for other images that see them among the frames near by: no search
// over all frames. Image s of frame f is f sensors_per_rig + s. Throws
// std::invalid_argument if an image finds no second one to share a point
// with. O(sightings).
Structure SampleStructure(const SceneOptions& options,
                          const Trajectory& trajectory, const Imaging& imaging,
                          Random* random);

}  // namespace krot::internal
