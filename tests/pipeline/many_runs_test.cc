#include <malloc.h>

#include <gtest/gtest.h>

#include "krot/pipeline/adjust_model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/synthetic/scene.h"

namespace krot {
namespace {

Model SmallScene() {
  SceneOptions options;
  options.num_frames = 4;
  options.num_points = 20;
  options.track_length = 3;
  options.pixel_noise = 0.5;
  options.start_point_noise = 1e-3;
  return SynthesizeScene(options).model;
}

// What is allocated and not given back. Sanitizers look for leaks themselves,
// and keep no such count.
size_t BytesInUse() { return mallinfo2().uordblks; }

TEST(ManyRuns, InOneProcessLeaveNothingBehind) {
  const Model model = SmallScene();
  const auto run = [&](int count) {
    for (int n = 0; n < count; ++n) {
      SolveModel(model, {});
      AdjustModel(model, {});
    }
  };
  run(20);  // threads, logs and caches come to stay
  const size_t before = BytesInUse();
  run(100);
  EXPECT_LE(BytesInUse(), before + 16384);
}

}  // namespace
}  // namespace krot
