#include "krot/pipeline/solve_model.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <vector>

#include <gtest/gtest.h>

#include "krot/model/validate.h"
#include "krot/problem/cost.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"

namespace krot {
namespace {

constexpr Ignoring kWhatASolveChanges = {true, true, true};

SceneOptions NoisyScene() {
  SceneOptions options;
  options.num_frames = 8;
  options.num_points = 100;
  options.track_length = 4;
  options.pixel_noise = 0.5;
  options.start_translation_noise = 0.005;
  options.start_point_noise = 0.005;
  return options;
}

// The cost of a model, from scratch.
double CostOf(const Model& model) {
  const BuiltProblem built = BuildProblem(model, {});
  return Cost(built.problem, built.start, Norm::L2(), 1);
}

TEST(SolveModel, ReportsTheCostsOfTheModelsItTakesAndGives) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  const SolveModelResult result = SolveModel(model, {});
  const SolveSummary& summary = result.summary;
  EXPECT_EQ(summary.termination, SolveTermination::kStalled);
  EXPECT_NEAR(summary.cost_initial, CostOf(model), 1e-9);
  EXPECT_NEAR(summary.cost_final, CostOf(result.model), 1e-9);
  EXPECT_LT(summary.cost_final, summary.cost_initial);
  EXPECT_EQ(summary.sweeps.back().cost, summary.cost_final);
}

TEST(SolveModel, GivesAValidModelThatDiffersInPosesPointsAndErrorsOnly) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  const SolveModelResult result = SolveModel(model, {});
  EXPECT_NO_THROW(ValidateModel(result.model));
  EXPECT_THAT(result.model, IsModel(model, kWhatASolveChanges));
}

TEST(SolveModel, MeasuresPixelErrorsBeforeAndAfterAndStoresThem) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  const SolveModelResult result = SolveModel(model, {});
  const std::vector<double> after_px = PixelErrors(result.model);
  EXPECT_EQ(result.summary.pixel_error_before.max,
            Summarize(PixelErrors(model)).max);
  EXPECT_EQ(result.summary.pixel_error_after.max, Summarize(after_px).max);
  Model updated = result.model;
  UpdatePointErrors(after_px, &updated);
  EXPECT_THAT(result.model, IsModel(updated));
}

TEST(SolveModel, GivesTheSameBitsAtAnyNumberOfThreads) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  SolveModelOptions options;
  options.res_int.max_sweeps = 5;
  options.res_int.num_threads = 1;
  const Model expected = SolveModel(model, options).model;
  options.res_int.num_threads = 3;
  options.problem.num_threads = 3;
  EXPECT_THAT(SolveModel(model, options).model, IsModel(expected));
}

TEST(SolveModel, ReturnsTheModelUnchangedIfThereIsNothingToSolve) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  SolveModelOptions options;
  options.problem.min_track_length = 1000;
  const SolveModelResult result = SolveModel(model, options);
  EXPECT_EQ(result.summary.termination, SolveTermination::kNothingToSolve);
  EXPECT_EQ(result.summary.num_observations, 0);
  EXPECT_EQ(std::accumulate(result.summary.left_out.begin(),
                            result.summary.left_out.end(), int64_t{0}),
            static_cast<int64_t>(model.track_elements.size()));
  EXPECT_THAT(result.model, IsModel(model));
}

TEST(SolveModel, AnnouncesTheCountsBeforeItSolves) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  SolveModelOptions options;
  int num_calls = 0;
  int num_sweeps = 0;
  options.on_built = [&](const SolveSummary& summary) {
    ++num_calls;
    EXPECT_EQ(num_sweeps, 0);
    EXPECT_EQ(summary.num_images, 8);
    EXPECT_EQ(summary.num_points, 100);
    EXPECT_EQ(summary.num_observations,
              static_cast<int64_t>(model.track_elements.size()));
  };
  options.res_int.callback = [&](int, const Sweep&) { ++num_sweeps; };
  SolveModel(model, options);
  EXPECT_EQ(num_calls, 1);
  EXPECT_GT(num_sweeps, 0);
}

TEST(SolveModel, GivesTheBestSoFarWhenInterrupted) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  CancelFlag cancel{false};
  SolveModelOptions options;
  options.res_int.sweep_tolerance = 0;
  options.res_int.cancel = &cancel;
  options.res_int.callback = [&](int sweep, const Sweep&) {
    if (sweep == 2) cancel = true;
  };
  const SolveModelResult result = SolveModel(model, options);
  EXPECT_EQ(result.summary.termination, SolveTermination::kInterrupted);
  EXPECT_EQ(result.summary.sweeps.size(), 2u);
  EXPECT_NEAR(CostOf(result.model), result.summary.sweeps.back().cost, 1e-9);
}

TEST(SolveModel, KeepsAnImageWithoutPoseAndCountsItsObservations) {
  SceneOptions scene = NoisyScene();
  scene.has_rigs = false;
  Model model = SynthesizeScene(scene).model;
  model.images[0].cam_from_world.translation.setConstant(
      std::numeric_limits<double>::quiet_NaN());
  int64_t num_observations = 0;
  for (const TrackElement& element : model.track_elements) {
    num_observations += element.image_id == model.images[0].id;
  }
  const SolveModelResult result = SolveModel(model, {});
  EXPECT_EQ(result.summary.left_out[static_cast<int>(LeftOut::kNoPose)],
            num_observations);
  EXPECT_EQ(result.summary.pixel_error_after.not_finite, num_observations);
  EXPECT_THAT(result.model, IsModel(model, kWhatASolveChanges));
}

TEST(TriangulateModel, MovesPointsOnlyAndLowersTheLargestErrorOfEveryTrack) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  const SolveModelResult result = TriangulateModel(model, {});
  Ignoring points;
  points.coordinates = true;
  points.point_errors = true;
  EXPECT_THAT(result.model, IsModel(model, points));

  // Linearised pixels differ a little from true ones.
  const std::vector<double> before_px = PixelErrors(model);
  const std::vector<double> after_px = PixelErrors(result.model);
  for (const Point3D& point : model.points3D) {
    const auto largest = [&point](const std::vector<double>& errors_px) {
      return *std::max_element(errors_px.begin() + point.track_begin,
                               errors_px.begin() + point.track_end);
    };
    EXPECT_LE(largest(after_px), 1.001 * largest(before_px));
  }
}

TEST(TriangulateModel, IsDoneAfterOneSweep) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  const SolveModelResult once = TriangulateModel(model, {});
  const SolveModelResult twice = TriangulateModel(once.model, {});
  EXPECT_EQ(once.summary.sweeps.size(), 1u);
  EXPECT_NEAR(twice.summary.cost_final, once.summary.cost_final,
              1e-9 * once.summary.cost_final);
}

TEST(EstimateSolveBytes, GrowsWithTheObservations) {
  const Model model = SynthesizeScene(NoisyScene()).model;
  const int64_t num_observations =
      static_cast<int64_t>(model.track_elements.size());
  EXPECT_GT(EstimateSolveBytes(model), 100 * num_observations);
  EXPECT_LT(EstimateSolveBytes(model), 1000 * num_observations);
  EXPECT_EQ(EstimateSolveBytes(Model()), 0);
}

}  // namespace
}  // namespace krot
