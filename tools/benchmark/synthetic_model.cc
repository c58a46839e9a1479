#include "tools/benchmark/synthetic_model.h"

#include <string>

#include "krot/synthetic/scene.h"

namespace krot::internal {

BenchmarkModel SyntheticModel(const ModelSize& size, uint64_t seed) {
  SceneOptions options;
  options.layout =
      size.num_frames <= 20 ? SceneLayout::kOrbit : SceneLayout::kStreet;
  options.num_frames = size.num_frames;
  options.num_points = size.num_points;
  options.track_length =
      static_cast<double>(size.num_observations) / size.num_points;
  options.camera_model_id = 1;  // PINHOLE
  options.has_rigs = false;
  options.pixel_noise = 1;
  options.start_translation_noise = 0.01;
  options.start_point_noise = 0.01;
  options.random_seed = seed;
  const SyntheticScene scene = SynthesizeScene(options);
  BenchmarkModel model;
  model.name = std::string("synthetic ") + size.name;
  model.num_images = static_cast<int64_t>(scene.model.images.size());
  model.built = BuildProblem(scene.model, {});
  return model;
}

}  // namespace krot::internal
