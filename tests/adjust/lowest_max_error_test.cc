#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/model.h"
#include "krot/pipeline/adjust_model.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

// What lower_max_error ends at is compared with what is known of the same
// scene: the certified optimum with rotations fixed, bounded adjustments, and
// ends from other starts.

namespace krot::internal {
namespace {

const Context kLowerAlone{1};

SceneOptions NoisyOptions() { return SceneOf(8, 80, 5, 1, 9); }

AdjustModelOptions Lowered() {
  AdjustModelOptions options;
  options.adjustment.lower_max_error = true;
  return options;
}

AdjustModelOptions RotationsAndCamerasFixed() {
  AdjustModelOptions options = Lowered();
  options.adjustment.constant_rig_from_world_rotation = true;
  options.adjustment.refine_sensor_from_rig = false;
  options.adjustment.refine_focal_length = false;
  options.adjustment.refine_extra_params = false;
  return options;
}

double MaxError(const Model& model) {
  return Summarize(PixelErrors(model, 1)).max;
}

TEST(LowestMaxError, IsBelowWhatFixedRotationsAndWhatACapAllow) {
  for (const int sensors_per_rig : {1, 2}) {
    SceneOptions scene = NoisyOptions();
    scene.sensors_per_rig = sensors_per_rig;
    const Model model = SynthesizeScene(scene).model;
    const AdjustModelResult lowered =
        AdjustModel(model, Lowered(), kLowerAlone);
    const AdjustModelSummary& summary = lowered.summary;
    EXPECT_EQ(summary.adjustment.termination,
              BundleAdjustmentTermination::kCapConverged);
    const double max = MaxError(lowered.model);
    EXPECT_LT(max, *summary.max_error);
    EXPECT_LE(*summary.max_error,
              1.0005 * *summary.adjustment.lowest_max_error * (1 + 1e-12));
    EXPECT_LE(max, summary.start->LowestCost());
    EXPECT_TRUE(summary.adjustment.is_lowest_max_error_converged);
    // Rotations and intrinsics gain something.
    EXPECT_LT(max, 0.99 * *summary.start->lower_bound);

    AdjustModelOptions bounded;
    bounded.max_error_factor = 1.02;
    EXPECT_LE(max, MaxError(AdjustModel(model, bounded, kLowerAlone).model));
  }
}

TEST(LowestMaxError, IsTheSameFromOtherStarts) {
  std::vector<double> ends;
  for (const uint64_t seed : {1, 2, 3}) {
    // The same observations; other rotations, translations and points.
    SceneOptions scene = NoisyOptions();
    Model model = SynthesizeScene(scene).model;
    scene.rotation_noise_deg = 0.2;
    scene.start_translation_noise = 0.01;
    scene.start_point_noise = 0.01;
    const Model moved = SynthesizeScene(scene).model;
    ASSERT_EQ(moved.frames.size(), model.frames.size());
    for (size_t f = 0; f < model.frames.size(); ++f) {
      if (f % 3 + 1 == seed) continue;
      model.frames[f].rig_from_world = moved.frames[f].rig_from_world;
    }
    ends.push_back(*AdjustModel(model, Lowered(), kLowerAlone)
                        .summary.adjustment.lowest_max_error);
  }
  EXPECT_NEAR(ends[1], ends[0], 1e-3 * ends[0]);
  EXPECT_NEAR(ends[2], ends[0], 1e-3 * ends[0]);
}

TEST(LowestMaxError, LeavesLeastSquaresWhereNothingIsGained) {
  const Model model = SynthesizeScene(NoisyOptions()).model;
  const AdjustModelResult result =
      AdjustModel(model, RotationsAndCamerasFixed(), kLowerAlone);
  const double lowest = result.summary.start->LowestCost();
  EXPECT_EQ(result.summary.adjustment.termination,
            BundleAdjustmentTermination::kCapConverged);
  EXPECT_LE(*result.summary.adjustment.lowest_max_error, lowest);
  EXPECT_LE(MaxError(result.model), 1.0005 * lowest);
  EXPECT_LT(result.summary.pixel_error_after.rms,
            result.summary.pixel_error_start.rms);
}

TEST(LowestMaxError, IsNotConvergedWhereTheIterationsWereTooFew) {
  const Model model = SynthesizeScene(NoisyOptions()).model;
  AdjustModelOptions options = Lowered();
  options.adjustment.max_num_iterations = 5;
  const AdjustModelResult result = AdjustModel(model, options, kLowerAlone);
  EXPECT_TRUE(result.summary.adjustment.lowest_max_error);
  EXPECT_FALSE(result.summary.adjustment.is_lowest_max_error_converged);
}

TEST(LowestMaxError, IsThatOfTheBestIterateWhenCancelled) {
  const Model model = SynthesizeScene(NoisyOptions()).model;
  CancelFlag cancel{false};
  AdjustModelOptions options = Lowered();
  options.adjustment.callback =
      [&](const BundleAdjustmentIteration& iteration) {
        EXPECT_TRUE(iteration.cap.has_value());
        cancel = iteration.iteration == 3;
      };
  const AdjustModelResult result = AdjustModel(model, options, {1, &cancel});
  EXPECT_EQ(result.summary.adjustment.termination,
            BundleAdjustmentTermination::kInterrupted);
  EXPECT_EQ(result.summary.adjustment.num_iterations, 3);
  EXPECT_LE(MaxError(result.model),
            1.0005 * result.summary.start->LowestCost());
}

TEST(LowestMaxError, EndsWithTheIterationsThatAreAllowed) {
  const Model model = SynthesizeScene(NoisyOptions()).model;
  AdjustModelOptions options = Lowered();
  options.adjustment.max_num_iterations = 4;
  const AdjustModelResult result = AdjustModel(model, options, kLowerAlone);
  EXPECT_EQ(result.summary.adjustment.termination,
            BundleAdjustmentTermination::kMaxIterations);
  EXPECT_LE(MaxError(result.model),
            1.0005 * result.summary.start->LowestCost());
}

TEST(LowestMaxError, IsRefusedTogetherWithACap) {
  const Model model = SynthesizeScene(NoisyOptions()).model;
  BundleAdjustmentOptions options = Lowered().adjustment;
  options.max_error = 3;
  EXPECT_THROW(AdjustBundle(model, options), std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
