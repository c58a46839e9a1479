#pragma once

#include <cmath>

#include "krot/synthetic/scene.h"

namespace krot {

// Small scenes with pinhole cameras, half a pixel of noise and outliers.
inline SyntheticScene MakeOutlierScene(uint64_t seed, double outlier_ratio,
                                       int num_points = 60) {
  SceneOptions options;
  options.num_frames = 6;
  options.num_points = num_points;
  options.track_length = 4;
  options.camera_model_id = 1;
  options.pixel_noise = 0.5;
  options.outlier_ratio = outlier_ratio;
  options.random_seed = seed;
  return SynthesizeScene(options);
}

}  // namespace krot
