#pragma once

#include <random>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/model.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {

// A noisy scene of two sensors per rig: the blocks of its start, and a cap
// somewhat above their largest error.
inline AdjustmentBlocks SmallBlocks(int camera_model_id, uint64_t seed = 3) {
  SceneOptions options = SceneOf(4, 12, 5, 1, seed);
  options.camera_model_id = camera_model_id;
  options.sensors_per_rig = 2;
  options.start_point_noise = 1e-3;
  const Model model = SynthesizeScene(options).model;
  AdjustmentBlocks blocks = MakeAdjustmentBlocks(model, 2);
  const double max_error = Summarize(PixelErrors(model, 1)).max;
  blocks.cap2 = 1.1 * max_error * max_error;
  return blocks;
}

// Standard normal numbers for all unknowns.
inline BlockVector RandomDirection(size_t num_points, size_t num_blocks) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  BlockVector direction;
  direction.SetZero(num_points, num_blocks);
  for (auto* list : {&direction.points, &direction.frames}) {
    for (Eigen::Vector3d& x : *list) {
      for (int i = 0; i < 3; ++i) x[i] = normal(random);
    }
  }
  return direction;
}

}  // namespace krot::internal
