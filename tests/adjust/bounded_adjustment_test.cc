#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/multiplier_oracle.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

const Context kOneThread{1};

// The lowest maximum of a noisy scene, where least squares cannot stay.
Model NoisyScene(int sensors_per_rig = 1) {
  SceneOptions options = SceneOf(8, 80, 5, 1, 9);
  options.sensors_per_rig = sensors_per_rig;
  return SolveModel(SynthesizeScene(options).model, {}).model;
}

BundleAdjustmentOptions WithCap(double max_error) {
  BundleAdjustmentOptions options;
  options.max_error = max_error;
  return options;
}

PixelErrorStatistics ErrorsOf(const Model& model) {
  return Summarize(PixelErrors(model, 1));
}

TEST(BoundedAdjustment, KeepsEveryErrorBelowTheCapAndTheRmsFallsAsItRises) {
  for (const int sensors_per_rig : {1, 2}) {
    const Model model = NoisyScene(sensors_per_rig);
    const PixelErrorStatistics start = ErrorsOf(model);
    double last_rms = start.rms;
    for (const double factor : {1.02, 1.05, 2.0, 4.0}) {
      const double cap = factor * start.max;
      const BundleAdjustmentResult result =
          AdjustBundle(model, WithCap(cap), kOneThread);
      EXPECT_EQ(result.summary.termination,
                BundleAdjustmentTermination::kCapConverged);
      EXPECT_LE(*result.summary.duality_gap, 1e-4);
      EXPECT_LE(*result.summary.stationarity, 1e-6);
      EXPECT_EQ(result.summary.num_active > 0, factor < 1.1);
      const PixelErrorStatistics errors = ErrorsOf(result.model);
      EXPECT_LT(errors.max, cap);
      EXPECT_LE(errors.rms, last_rms * (1 + 1e-4));
      last_rms = errors.rms;
    }
  }
}

TEST(BoundedAdjustment, EndsWhereTheMethodOfMultipliersDoes) {
  for (const int sensors_per_rig : {1, 2}) {
    const Model model = NoisyScene(sensors_per_rig);
    for (const double factor : {1.02, 1.1}) {
      const double cap = factor * ErrorsOf(model).max;
      const LagrangianEnd expected = MinimizeByMultipliers(model, {}, cap, 20);
      EXPECT_NEAR(expected.max_error, cap, 1e-6 * cap);
      const BundleAdjustmentSummary summary =
          AdjustBundle(model, WithCap(cap), kOneThread).summary;
      // Inside the cap, so above it, by what the gap allows.
      EXPECT_GT(summary.cost_final, expected.cost);
      EXPECT_LT(summary.cost_final, (1 + *summary.duality_gap) * expected.cost);
    }
  }
}

TEST(BoundedAdjustment, HasTheSameBitsAtAnyNumberOfThreads) {
  const Model model = NoisyScene(2);
  const BundleAdjustmentOptions options = WithCap(1.02 * ErrorsOf(model).max);
  const Model expected = AdjustBundle(model, options, kOneThread).model;
  for (const int num_threads : {2, 3, 8}) {
    const Model result = AdjustBundle(model, options, {num_threads}).model;
    for (size_t k = 0; k < model.points3D.size(); ++k) {
      EXPECT_EQ(result.points3D[k].xyz, expected.points3D[k].xyz);
    }
    EXPECT_EQ(result.cameras[0].params, expected.cameras[0].params);
  }
}

TEST(BoundedAdjustment, EqualsThePlainOneAtALargeCap) {
  const Model model = NoisyScene();
  BundleAdjustmentOptions plain = WithCap(1);
  plain.max_error.reset();
  const double expected =
      AdjustBundle(model, plain, kOneThread).summary.cost_final;
  const BundleAdjustmentSummary bounded =
      AdjustBundle(model, WithCap(1e3), kOneThread).summary;
  EXPECT_NEAR(bounded.cost_final, expected, 1e-3 * expected);
  EXPECT_EQ(bounded.num_active, 0);
}

// No derivative, no barrier: among many small displacements of the result that
// keep every error below the cap, none has a lower cost by more than the gap.
TEST(BoundedAdjustment, IsNotImprovedByFeasibleDisplacements) {
  const Model start = NoisyScene();
  BundleAdjustmentOptions options = WithCap(1.001 * ErrorsOf(start).max);
  options.refine_rig_from_world = false;
  options.refine_focal_length = false;
  options.refine_extra_params = false;
  const BundleAdjustmentResult result =
      AdjustBundle(start, options, kOneThread);
  const double gap = *result.summary.duality_gap * result.summary.cost_final;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  int num_feasible = 0;
  double lowest = result.summary.cost_final;
  for (const double sigma : {1e-5, 1e-4, 1e-3}) {
    for (int trial = 0; trial < 300; ++trial) {
      Model moved = result.model;
      Point3D& point = moved.points3D[trial % moved.points3D.size()];
      for (int i = 0; i < 3; ++i) point.xyz[i] += sigma * normal(random);
      const PixelErrorStatistics errors = ErrorsOf(moved);
      if (!(errors.max < *options.max_error)) continue;
      ++num_feasible;
      lowest = std::min(lowest, errors.rms * errors.rms / 2 *
                                    static_cast<double>(errors.count));
    }
  }
  EXPECT_GT(num_feasible, 100);
  EXPECT_GE(lowest, result.summary.cost_final - gap);
}

TEST(BoundedAdjustment, RefusesAStartAtTheCapAndLeavesItAlone) {
  const Model model = NoisyScene();
  const BundleAdjustmentResult result =
      AdjustBundle(model, WithCap(0.99 * ErrorsOf(model).max), kOneThread);
  EXPECT_EQ(result.summary.termination,
            BundleAdjustmentTermination::kInfeasibleStart);
  EXPECT_EQ(result.model.points3D[0].xyz, model.points3D[0].xyz);
}

TEST(BoundedAdjustment, StopsBelowTheCapWhenCancelled) {
  const Model model = NoisyScene();
  BundleAdjustmentOptions options = WithCap(1.01 * ErrorsOf(model).max);
  CancelFlag cancel{false};
  options.callback = [&](const BundleAdjustmentIteration& iteration) {
    EXPECT_TRUE(iteration.barrier.has_value());
    cancel = iteration.iteration == 2;
  };
  const BundleAdjustmentResult result =
      AdjustBundle(model, options, {1, &cancel});
  EXPECT_EQ(result.summary.termination,
            BundleAdjustmentTermination::kInterrupted);
  EXPECT_LT(ErrorsOf(result.model).max, *options.max_error);
}

}  // namespace
}  // namespace krot::internal
