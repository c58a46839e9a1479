// The finish through full cameras, beside Ceres, which shares no solver with
// it.

#include "krot/pipeline/stages.h"

#include <cmath>

#include <gtest/gtest.h>

#include "krot/synthetic/scene.h"
#include "tests/testing/multiplier_oracle.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

Model NoisyModel(int camera_model_id) {
  SceneOptions options = SceneOf(8, 150, 5, 0.7);
  options.camera_model_id = camera_model_id;
  options.start_translation_noise = 0.005;
  options.start_point_noise = 0.005;
  return SynthesizeScene(options).model;
}

SolveModelOptions With(Finish finish) {
  SolveModelOptions options;
  options.finish.finish = finish;
  return options;
}

class RunFinishOf : public testing::TestWithParam<int> {};

TEST_P(RunFinishOf, EndsWhereTheMethodOfMultipliersEndsBelowTheSameCap) {
  const Model model = NoisyModel(GetParam());
  SolveModelOptions options = With(Finish::kLeastSquares);
  // Nearer to the lowest maximum that method hardly converges.
  options.finish.slack = 0.05;
  const SolveModelResult finished = SolveModel(model, options);
  ASSERT_TRUE(finished.summary.finish.has_value());
  const double cap = finished.summary.finish->cap;
  EXPECT_LE(finished.summary.pixel_error_after.max, cap);

  BundleAdjustmentOptions what_moves;
  what_moves.constant_rig_from_world_rotation = true;
  what_moves.refine_sensor_from_rig = false;
  what_moves.refine_focal_length = false;
  what_moves.refine_extra_params = false;
  const SolveModelResult lowest = SolveModel(model, With(Finish::kNone));
  const LagrangianEnd expected =
      MinimizeByMultipliers(lowest.model, what_moves, cap, 200);
  EXPECT_NEAR(expected.max_error, cap, 1e-4 * cap);
  const double rms =
      std::sqrt(2 * expected.cost /
                static_cast<double>(finished.summary.pixel_error_after.count));
  EXPECT_NEAR(finished.summary.pixel_error_after.rms, rms, 1e-3 * rms);
  EXPECT_LT(rms, 0.99 * lowest.summary.pixel_error_after.rms);
}

// SIMPLE_PINHOLE, OPENCV, OPENCV_FISHEYE: rows that stay, and rows that do not.
INSTANTIATE_TEST_SUITE_P(Cameras, RunFinishOf, testing::Values(0, 4, 5));

// Its own slack may not make the second result worse than the first.
TEST(RunFinish, LeavesAModelThatItMadeNoWorse) {
  const SolveModelResult once = SolveModel(NoisyModel(4), {});
  const SolveModelResult twice = SolveModel(once.model, {});
  EXPECT_FALSE(twice.summary.is_given_back);
  EXPECT_LE(twice.summary.pixel_error_after.max,
            (1 + 1e-9) * once.summary.pixel_error_after.max);
  EXPECT_NEAR(twice.summary.pixel_error_after.rms,
              once.summary.pixel_error_after.rms,
              1e-3 * once.summary.pixel_error_after.rms);
}

TEST(RunFinish, HasRoomAboveAMaximumThatIsKnownToACoarseGap) {
  SolveModelOptions options = With(Finish::kNone);
  options.joint.relative_gap = 1e-2;
  const SolveModelResult lowest = SolveModel(NoisyModel(4), options);
  ASSERT_GT(*lowest.summary.relative_gap, options.finish.slack);
  options.finish.finish = Finish::kLeastSquares;
  const SolveModelResult finished = SolveModel(NoisyModel(4), options);
  EXPECT_LE(finished.summary.cost_final,
            (1 + options.finish.slack) * lowest.summary.cost_final);
  EXPECT_LT(finished.summary.pixel_error_after.rms,
            0.99 * lowest.summary.pixel_error_after.rms);
}

TEST(RunFinish, UsesTheRoomThatACapLeavesAboveTheStart) {
  const SolveModelResult once = SolveModel(NoisyModel(4), {});
  SolveModelOptions options;
  options.finish.max_error = 1.1 * once.summary.pixel_error_after.max;
  const SolveSummary summary = SolveModel(once.model, options).summary;
  EXPECT_FALSE(summary.is_given_back);
  ASSERT_TRUE(summary.finish.has_value());
  EXPECT_EQ(summary.finish->cap, *options.finish.max_error);
  EXPECT_LE(summary.pixel_error_after.max, *options.finish.max_error);
  EXPECT_LT(summary.pixel_error_after.rms, once.summary.pixel_error_after.rms);
}

TEST(RunFinish, LeavesOutWhatACapBelowTheLowestMaximumForbids) {
  SolveModelOptions options;
  options.finish.max_error = 1e-3;
  const SolveSummary summary = SolveModel(NoisyModel(4), options).summary;
  EXPECT_FALSE(summary.finish.has_value());
  EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
}

}  // namespace
}  // namespace krot::internal
