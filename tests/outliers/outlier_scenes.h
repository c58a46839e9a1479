#pragma once

#include <cmath>

#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {

// Small scenes with pinhole cameras, noise and outliers.
inline SceneOptions OutlierScene(uint64_t seed, double outlier_ratio,
                                 int num_points, double pixel_noise) {
  SceneOptions options = SceneOf(6, num_points, 4, pixel_noise, seed);
  options.camera_model_id = 1;
  options.outlier_ratio = outlier_ratio;
  return options;
}

inline SyntheticScene MakeOutlierScene(uint64_t seed, double outlier_ratio,
                                       int num_points = 60,
                                       double pixel_noise = 0.5) {
  return SynthesizeScene(
      OutlierScene(seed, outlier_ratio, num_points, pixel_noise));
}

}  // namespace krot::internal
