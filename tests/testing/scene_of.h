#pragma once

#include <cstdint>

#include "krot/synthetic/scene.h"

namespace krot::internal {

// A scene of this size, in which the images see the points with this noise; all
// else is as by default.
inline SceneOptions SceneOf(int num_frames, int num_points,
                            double track_length = SceneOptions().track_length,
                            double pixel_noise = 0, uint64_t seed = 0) {
  SceneOptions options;
  options.num_frames = num_frames;
  options.num_points = num_points;
  options.track_length = track_length;
  options.pixel_noise = pixel_noise;
  options.random_seed = seed;
  return options;
}

}  // namespace krot::internal
