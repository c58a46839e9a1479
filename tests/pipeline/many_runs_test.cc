#include <malloc.h>

#include <gtest/gtest.h>

#include <thread>

#include "krot/pipeline/adjust_model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/synthetic/scene.h"

namespace krot::internal {
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
  // A thread keeps some of what it frees, which counts as in use, until it
  // ends: one that ends with its runs leaves only what they left.
  const auto run = [&](int count) {
    std::thread([&] {
      Context context;
      context.num_threads = 1;
      for (int n = 0; n < count; ++n) {
        SolveModel(model, {}, context);
        AdjustModel(model, {}, context);
      }
    }).join();
  };
  run(3);  // what is made once comes to stay
  const size_t before = BytesInUse();
  run(50);
  EXPECT_LE(BytesInUse(), before + 50);
}

}  // namespace
}  // namespace krot::internal
