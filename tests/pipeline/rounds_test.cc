#include "krot/pipeline/rounds.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "krot/analysis/pixel_errors.h"
#include "krot/bridge/reprojection.h"
#include "krot/model/model_io.h"
#include "krot/problem/cost.h"
#include "tests/bridge/lens_model.h"

namespace krot {
namespace {

// What rounding may add to a cost, relative.
constexpr double kRounding = 1e-9;

void ExpectNoRise(const SolveSummary& summary) {
  double last = summary.cost_initial;
  for (const Round& round : summary.rounds) {
    EXPECT_LE(round.cost, last);
    last = round.cost;
  }
  EXPECT_LE(summary.cost_final, (1 + kRounding) * last);
}

// Nothing left to gain to first order: the last rows promise no lower maximum.
void ExpectStationary(const SolveSummary& summary, double tolerance) {
  ASSERT_FALSE(summary.rounds.empty());
  EXPECT_GE(summary.rounds.back().linear_cost,
            (1 - tolerance) * summary.rounds.back().cost);
}

struct RealModel {
  const char* folder;
  double lowest, highest;  // of the optimum, pixels, by a reference solver
};

RealModel Near(const char* folder, double optimum) {
  return {folder, (1 - 1e-4) * optimum, (1 + 1e-4) * optimum};
}

class RoundsOfRealModel : public ::testing::TestWithParam<RealModel> {};

TEST_P(RoundsOfRealModel, EndAtTheReferenceOptimumAndProveItInPixels) {
  const char* root = std::getenv("KROT_REAL_MODELS");
  if (root == nullptr) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  const std::filesystem::path folder =
      std::filesystem::path(root) / GetParam().folder;
  const Model model = ReadModel(folder, DetectModelFormat(folder));
  const SolveModelResult result = SolveModel(model, {});
  const SolveSummary& summary = result.summary;
  const PixelErrorStatistics before = Summarize(PixelErrors(model));
  const PixelErrorStatistics after = Summarize(PixelErrors(result.model));
  EXPECT_FALSE(summary.is_given_back);
  EXPECT_LE(after.max, (1 + kRounding) * before.max);
  EXPECT_LE(after.not_finite, before.not_finite);
  EXPECT_NEAR(after.max, summary.cost_final, 1e-9);
  ExpectNoRise(summary);
  ExpectStationary(summary, 1e-3);
  EXPECT_GE(summary.cost_final, GetParam().lowest);
  EXPECT_LE(summary.cost_final, GetParam().highest);
  ASSERT_TRUE(summary.is_certified);
  EXPECT_GE(*summary.lower_bound, 0.999 * summary.cost_final);
  EXPECT_LE(*summary.lower_bound, summary.cost_final);
}

INSTANTIATE_TEST_SUITE_P(
    Local, RoundsOfRealModel,
    ::testing::Values(Near("strong_tank96", 3.6057),
                      Near("strong_gazebo111", 3.4201),
                      // The reference crawls towards it.
                      RealModel{"strong_endo93_txt", 0, 3.63},
                      Near("fold19", 3.6125),
                      Near("task41_rigs_frames", 3.5041)),
    [](const auto& test) { return std::string(test.param.folder); });

// A strong lens, from a start that its errors are tens of pixels at.
Model DisturbedModel(unsigned seed) {
  LensModelOptions options;
  options.seed = seed;
  options.num_points = 12;
  Model model = MakeLensModel(options);
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-0.05, 0.05);
  for (Point3D& point : model.points3D) {
    for (double& value : point.xyz) value += uniform(generator);
  }
  return model;
}

TEST(SolveInRounds, NeverRaisesTheTrueMaximumAndEndsStationary) {
  for (const double p : {1.0, 2.0, static_cast<double>(INFINITY)}) {
    const Model model = DisturbedModel(p == 2 ? 1 : 2);
    SolveModelOptions options;
    options.norm = {p};
    const SolveSummary summary = SolveModel(model, options).summary;
    ExpectNoRise(summary);
    EXPECT_GT(summary.rounds.size(), 1u);
    ExpectStationary(summary, 1e-4);
    EXPECT_LT(summary.cost_final, 3);
    ASSERT_TRUE(summary.is_certified);
    EXPECT_GE(*summary.lower_bound, 0.999 * summary.cost_final);
  }
}

TEST(SolveInRounds, IsOneRoundForPinholes) {
  LensModelOptions options;
  options.camera_model_id = 1;
  options.params = {500, 500, 320, 240};
  const SolveSummary summary = SolveModel(MakeLensModel(options), {}).summary;
  EXPECT_EQ(summary.rounds.size(), 1u);
  EXPECT_EQ(summary.termination, SolveTermination::kGapReached);
}

TEST(SolveInRounds, LeavesTheRowsOfItsLastEstimate) {
  const Model model = DisturbedModel(1);
  BuiltProblem built = BuildProblem(model, {});
  Estimate estimate = built.start;
  SolveSummary summary;
  SolveInRounds(model, {}, SolveMethod::kAuto, {}, Timer(), &built, &estimate,
                &summary);
  const double cost =
      Reprojection(model, built).TrueCost(estimate, Norm::L2(), 1);
  EXPECT_NEAR(summary.cost_final, cost, kRounding);
  EXPECT_NEAR(Cost(built.problem, estimate, Norm::L2(), 1), cost, kRounding);
}

}  // namespace
}  // namespace krot
