#include "krot/pipeline/stages.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "krot/convert/reprojection.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/problem/cost.h"
#include "tests/convert/lens_model.h"

namespace krot::internal {
namespace {

// What rounding may add to a cost, relative.
constexpr double kRounding = 1e-9;

void ExpectNoRise(const SolveSummary& summary) {
  double last = summary.cost_initial;
  for (const Round& round : summary.rounds) {
    EXPECT_LE(round.cost, last);
    last = round.cost;
  }
  EXPECT_LE(summary.LowestCost(), (1 + kRounding) * last);
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
  EXPECT_GE(summary.LowestCost(), GetParam().lowest);
  EXPECT_LE(summary.LowestCost(), GetParam().highest);
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

// One has points in cameras, one several optima at a fold of its lens, and of
// one a fifth of the cameras is within a millionth of the others' distances.
TEST(SolveModel, ProvesHardRealModelsWithinEightyIterations) {
  const char* root = std::getenv("KROT_REAL_MODELS");
  if (root == nullptr) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  for (const char* name : {"drone72_rig", "bandgap10", "hard_endo"}) {
    SCOPED_TRACE(name);
    const std::filesystem::path folder = std::filesystem::path(root) / name;
    const SolveSummary summary =
        SolveModel(ReadModel(folder, DetectModelFormat(folder)), {}).summary;
    ASSERT_TRUE(summary.is_certified);
    EXPECT_GE(*summary.lower_bound, 0.9999 * summary.LowestCost());
    EXPECT_LE(summary.iterations.size(), 80u);
  }
}

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

// An earlier round's rows have told how low it can get.
TEST(SolveInRounds, SolveNoRowsOnceSweepsHaveReachedAnEarlierBound) {
  SolveModelOptions options;
  options.joint.relative_gap = 1e-2;
  options.finish.finish = Finish::kNone;
  int num_by_sweeps = 0;
  for (unsigned seed = 1; seed <= 6; ++seed) {
    const SolveSummary summary =
        SolveModel(DisturbedModel(seed), options, {}).summary;
    ExpectNoRise(summary);
    EXPECT_TRUE(summary.is_certified);
    EXPECT_LE(*summary.relative_gap, options.joint.relative_gap);
    num_by_sweeps += !summary.rounds.back().linear_lower_bound.has_value();
  }
  EXPECT_GE(num_by_sweeps, 1);
}

TEST(SolveInRounds, LeavesTheRowsOfItsLastEstimate) {
  const Model model = DisturbedModel(1);
  BuiltProblem built = BuildProblem(model, {});
  Estimate estimate = built.start;
  SolveSummary summary;
  SolveInRounds({model, {}, SolveMethod::kAuto, {}, Timer()}, &built, &estimate,
                &summary);
  const double cost =
      Reprojection(model, built).TrueCost(estimate, Norm::L2(), 1);
  EXPECT_NEAR(summary.cost_final, cost, kRounding);
  EXPECT_NEAR(Cost(built.problem, estimate, Norm::L2(), 1), cost, kRounding);
}

// Points of odd id are seen by the first half of the images alone, the others,
// with larger errors and from a worse start, by the second.
Model ModelOfTwoComponents() {
  LensModelOptions options;
  options.camera_model_id = 1;
  options.params = {500, 500, 320, 240};
  options.num_images = 6;
  options.num_points = 24;
  Model model = MakeLensModel(options);
  std::vector<TrackElement> elements;
  for (Point3D& point : model.points3D) {
    const uint64_t begin = elements.size();
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = model.track_elements[e];
      const bool is_second_half = element.image_id > 3;
      Point2D& point2D =
          model.images[element.image_id - 1].points2D[element.point2D_idx];
      if (is_second_half == (point.id % 2 == 0)) {
        elements.push_back(element);
        if (is_second_half) point2D.x += 20 * std::sin(point2D.y);
      } else {
        point2D.point3D_id = kInvalidPoint3DId;
      }
    }
    point.track_begin = begin;
    point.track_end = elements.size();
    if (point.id % 2 == 0) point.xyz.z() *= point.id % 4 == 0 ? 1.5 : 0.7;
  }
  model.track_elements = elements;
  return model;
}

TEST(SolveInRounds, SaysThatIterationsWereUsedUpWhateverIsProvedByThen) {
  const Model model = ModelOfTwoComponents();
  SolveModelOptions options;
  options.method = SolveMethod::kJoint;
  int num_with_certificate = 0;
  for (int limit = 1; limit < 40; ++limit) {
    options.joint.max_iterations = limit;
    const SolveSummary summary = SolveModel(model, options).summary;
    if (summary.termination == SolveTermination::kGapReached) break;
    EXPECT_EQ(summary.termination, SolveTermination::kMaxIterations);
    num_with_certificate += summary.is_certified;
  }
  EXPECT_GT(num_with_certificate, 0);
}

TEST(SolveInRounds, EndsAfterTheRoundThatUsedUpItsIterations) {
  SolveModelOptions options;
  options.joint.max_iterations = 2;
  const SolveSummary summary = SolveModel(DisturbedModel(1), options).summary;
  EXPECT_EQ(summary.rounds.size(), 1u);
  EXPECT_EQ(summary.iterations.size(), 2u);
}

// Every pixel lies beyond what f (r + k r^3) reaches: no region, no proof.
TEST(SolveInRounds, IsNoAnswerWithoutABound) {
  Model model = MakeLensModel({});
  for (Image& image : model.images) {
    for (Point2D& point2D : image.points2D) point2D.x = 320 + 900;
  }
  const SolveSummary summary = SolveModel(model, {}).summary;
  EXPECT_EQ(summary.termination, SolveTermination::kUnproved);
  EXPECT_FALSE(summary.lower_bound);
}

// A thousand pixels off where all errors can be zero: rows that are exact only
// there have optima that say nothing.
TEST(SolveInRounds, TakesRowsAnewBeforeItSolvesThemFarFromWhereTheyHold) {
  LensModelOptions options;
  options.pixel_noise = 0;
  Model model = MakeLensModel(options);
  for (Frame& frame : model.frames) {
    frame.rig_from_world.translation +=
        Eigen::Vector3d(0.3, -0.2, 0.1) * static_cast<double>(frame.id % 3);
  }
  const SolveSummary summary = SolveModel(model, {}).summary;
  EXPECT_GT(summary.cost_initial, 50);
  EXPECT_EQ(summary.termination, SolveTermination::kZeroCost);
  EXPECT_LT(summary.iterations.size(), 100u);
}

}  // namespace
}  // namespace krot::internal
