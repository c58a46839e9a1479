#include <array>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/synthetic/scene.h"
#include "krot/tolerance/tolerance_analysis.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

// Metres for a unit of the truth.
constexpr double kMetres = 50;

struct MeasuredScene {
  MeasuredScene(uint64_t seed, int sensors_per_rig, int camera_model_id = 1) {
    SceneOptions options = SceneOf(6, 40, 4, 0.5, seed);
    options.camera_model_id = camera_model_id;
    options.has_rigs = sensors_per_rig > 1;
    options.sensors_per_rig = sensors_per_rig;
    const SyntheticScene scene = SynthesizeScene(options);
    model = scene.model;
    truth = scene.ground_truth;
    tolerance.max_error = 1.0001 * Summarize(PixelErrors(truth)).max;
  }

  // Asks for the distance between two ends: an image's index, or -1 - a
  // point's.
  void Ask(int a, int b) {
    KnownDistance distance;
    int side = 0;
    for (const int end : {a, b}) {
      distance.ends[side++] = {end >= 0, end >= 0 ? end : -1 - end};
    }
    tolerance.distances.push_back(distance);
  }
  double TrueMetres(size_t n) const {
    return kMetres * LengthsOf(truth, tolerance.distances)[n];
  }
  // The last one is known, `off` metres wrong.
  void Know(double within, double off = 0) {
    KnownDistance& distance = tolerance.distances.back();
    distance.metres = TrueMetres(tolerance.distances.size() - 1) + off;
    distance.tolerance = within;
  }
  std::vector<ToleranceLength> Lengths() const {
    return AnalyzeTolerances(model, tolerance).summary.lengths;
  }

  Model model;
  Model truth;
  ToleranceOptions tolerance;
};

// The bar is between cameras, points, or one of each, and off within its own
// tolerance; lenses and rigs take turns.
TEST(LengthsThatDataAllow, HoldTheTruthInEveryScene) {
  int num_lengths = 0;
  int num_proved = 0;
  for (uint64_t seed = 1; seed <= 36; ++seed) {
    SCOPED_TRACE(seed);
    MeasuredScene scene(seed, seed % 4 == 0 ? 2 : 1,
                        std::array{1, 2, 4}[seed % 3]);
    const std::array<std::array<int, 2>, 3> bars = {
        {{0, 3}, {-1, -8}, {2, -4}}};
    scene.Ask(bars[seed % 3][0], bars[seed % 3][1]);
    scene.Know(0.01, 0.009);
    scene.Ask(1, 4);
    scene.Ask(-2, -5);
    scene.Ask(0, -1);
    const std::vector<ToleranceLength> lengths = scene.Lengths();
    ASSERT_EQ(lengths.size(), 4u);
    EXPECT_TRUE(lengths[0].is_bar);
    for (size_t n = 1; n < lengths.size(); ++n) {
      const ToleranceLength& length = lengths[n];
      ++num_lengths;
      EXPECT_EQ(length.low.proved.has_value(), length.high.proved.has_value());
      if (!length.low.proved) continue;
      ++num_proved;
      EXPECT_LE(*length.low.proved, scene.TrueMetres(n)) << length.name;
      EXPECT_GE(*length.high.proved, scene.TrueMetres(n)) << length.name;
      EXPECT_LE(*length.low.proved, length.low.reached);
      EXPECT_LE(length.low.reached, length.length);
      EXPECT_LE(length.length, length.high.reached);
      EXPECT_LE(length.high.reached, *length.high.proved);
    }
  }
  EXPECT_GT(num_proved, 0.95 * num_lengths);
}

// By the ratio of two lengths, whatever the scale is.
TEST(LengthsThatDataAllow, HoldEveryRandomEstimate) {
  MeasuredScene scene(3, 1);
  scene.tolerance.max_error *= 1.3;
  scene.Ask(0, 3);
  scene.Know(1e-9);
  scene.Ask(1, 4);
  scene.Ask(-2, -5);
  const ToleranceResult result =
      AnalyzeTolerances(scene.model, scene.tolerance);
  const BuiltProblem built = BuildProblem(result.model, {});
  const Reprojection reprojection(result.model, built);
  std::mt19937 generator(1);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0, 1);
  Estimate now = built.start;
  for (int step = 0; step < 3000; ++step) {
    // A random way, of everything or of one frame or point.
    Estimate way = now;
    const auto chosen = static_cast<size_t>(
        uniform(generator) *
        static_cast<double>(now.points.size() + now.translations.size()));
    size_t index = 0;
    for (auto* list : {&way.points, &way.translations}) {
      for (Eigen::Vector3d& x : *list) {
        x.setZero();
        if (step % 2 == 1 && index++ != chosen) continue;
        x = {normal(generator), normal(generator), normal(generator)};
      }
    }
    const auto at = [&](double length) {
      Estimate moved = now;
      for (size_t f = 0; f < moved.translations.size(); ++f) {
        moved.translations[f] += length * way.translations[f];
      }
      for (size_t k = 0; k < moved.points.size(); ++k) {
        moved.points[k] += length * way.points[k];
      }
      return moved;
    };
    double length = 1;
    while (length > 1e-12 && !(reprojection.TrueCost(at(length), Norm{}, 1) <=
                               scene.tolerance.max_error)) {
      length /= 2;
    }
    now = at(length * uniform(generator));
    const std::vector<double> walked = LengthsOf(
        ApplyEstimate(result.model, built, now), scene.tolerance.distances);
    for (size_t n = 1; n < walked.size(); ++n) {
      const ToleranceLength& bounds = result.summary.lengths[n];
      const double metres = scene.TrueMetres(0) * walked[n] / walked[0];
      ASSERT_TRUE(bounds.low.proved);
      ASSERT_LE(*bounds.low.proved, metres + 1e-6) << "step " << step;
      ASSERT_GE(*bounds.high.proved, metres - 1e-6) << "step " << step;
    }
  }
}

TEST(LengthsThatDataAllow, AreNearlyReached) {
  double worst = 0;
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    MeasuredScene scene(seed, 1);
    scene.Ask(0, 3);
    scene.Know(1e-9);
    scene.Ask(1, 4);
    scene.Ask(2, 5);
    for (const ToleranceLength& length : scene.Lengths()) {
      if (length.is_bar || !length.low.proved) continue;
      const double proved = *length.high.proved - *length.low.proved;
      const double reached = length.high.reached - length.low.reached;
      worst = std::max(worst, proved / reached);
    }
  }
  // The box's diagonal and the bar's turn are of second order.
  EXPECT_LT(worst, 1.2);
}

TEST(LengthsThatDataAllow, AreInTheUnitOfTheGaugeWithoutABar) {
  MeasuredScene scene(4, 1);
  scene.Ask(1, 4);
  scene.tolerance.gauge_images = {0, 3};
  const ToleranceLength length = scene.Lengths()[0];
  ASSERT_TRUE(length.low.proved);
  const std::vector<double> in_model =
      LengthsOf(scene.model, scene.tolerance.distances);
  EXPECT_LE(*length.low.proved, in_model[0]);
  EXPECT_GE(*length.high.proved, in_model[0]);
  EXPECT_LT(*length.high.proved - *length.low.proved, in_model[0]);
}

TEST(LengthsThatDataAllow, OfARigAreItsOwnAndNeedNoBar) {
  MeasuredScene scene(8, 2);
  scene.Ask(0, 1);  // of one frame
  const ToleranceLength length = scene.Lengths()[0];
  ASSERT_TRUE(length.low.proved && length.high.proved);
  EXPECT_NEAR(*length.low.proved, length.length, 1e-12);
  EXPECT_NEAR(*length.high.proved, length.length, 1e-12);
}

TEST(LengthsThatDataAllow, ProveThatAWrongDistanceContradictsTheBar) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    MeasuredScene scene(seed, 1);
    scene.Ask(0, 3);
    scene.Know(0.01);
    scene.Ask(1, 4);
    scene.Know(0.01);
    scene.Ask(2, 5);
    scene.Know(0.01, 0.2 * scene.TrueMetres(2));
    const std::vector<ToleranceLength> lengths = scene.Lengths();
    EXPECT_FALSE(lengths[0].IsContradicted());
    EXPECT_FALSE(lengths[1].IsContradicted());
    EXPECT_TRUE(lengths[2].IsContradicted()) << seed;
  }
}

TEST(LengthsThatDataAllow, HaveNoEndsWhereNothingHoldsThem) {
  MeasuredScene scene(2, 1);
  scene.tolerance.max_error = 1e3;  // every point may be anywhere
  scene.Ask(0, 3);
  scene.Know(0.01);
  scene.Ask(-1, -2);
  const ToleranceLength length = scene.Lengths()[1];
  EXPECT_FALSE(length.low.proved);
  EXPECT_FALSE(length.high.proved);
  EXPECT_TRUE(length.is_free);
}

TEST(LengthsThatDataAllow, HaveTheSameBitsAtAnyNumberOfThreads) {
  MeasuredScene scene(9, 1);
  scene.Ask(0, 3);
  scene.Know(0.01);
  scene.Ask(1, 4);
  scene.Ask(-2, -5);
  std::vector<ToleranceLength> lengths[2];
  for (const int run : {0, 1}) {
    Context context;
    context.num_threads = 1 + 2 * run;
    lengths[run] = AnalyzeTolerances(scene.model, scene.tolerance, context)
                       .summary.lengths;
  }
  for (size_t n = 0; n < lengths[0].size(); ++n) {
    EXPECT_EQ(lengths[0][n].low.proved, lengths[1][n].low.proved);
    EXPECT_EQ(lengths[0][n].high.proved, lengths[1][n].high.proved);
    EXPECT_EQ(lengths[0][n].high.reached, lengths[1][n].high.reached);
  }
}

}  // namespace
}  // namespace krot::internal
