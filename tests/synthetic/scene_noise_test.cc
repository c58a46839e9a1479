#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "krot/model.h"
#include "krot/synthetic/scene.h"
#include "tests/synthetic/scene_geometry.h"

namespace krot::internal {
namespace {

bool SamePixels(const Model& a, const Model& b) {
  if (a.images.size() != b.images.size()) return false;
  for (size_t j = 0; j < a.images.size(); ++j) {
    const auto& points_a = a.images[j].points2D;
    const auto& points_b = b.images[j].points2D;
    if (points_a.size() != points_b.size()) return false;
    for (size_t n = 0; n < points_a.size(); ++n) {
      if (points_a[n].x != points_b[n].x || points_a[n].y != points_b[n].y) {
        return false;
      }
    }
  }
  return true;
}

TEST(SceneNoise, IsGaussianWithTheSigmaAskedFor) {
  SceneOptions options;
  options.num_points = 5000;
  options.pixel_noise = 0.7;
  const auto observations =
      RecomputeObservations(SynthesizeScene(options).ground_truth);
  double sum2 = 0;
  for (const SceneObservation& o : observations) {
    sum2 += o.ErrorPx() * o.ErrorPx();
  }
  const double n = 2 * static_cast<double>(observations.size());
  const double variance = 0.7 * 0.7;
  EXPECT_NEAR(sum2 / n, variance, 5 * variance * std::sqrt(2 / n));
}

TEST(SceneNoise, MovesTheListedOutliersOnly) {
  SceneOptions options;
  options.num_points = 3000;
  options.outlier_ratio = 0.1;
  const SyntheticScene scene = SynthesizeScene(options);
  const auto observations = RecomputeObservations(scene.ground_truth);
  const std::set<int64_t> outliers(scene.outliers.begin(),
                                   scene.outliers.end());
  EXPECT_TRUE(std::is_sorted(scene.outliers.begin(), scene.outliers.end()));
  const double count = static_cast<double>(observations.size());
  EXPECT_NEAR(static_cast<double>(outliers.size()), 0.1 * count,
              5 * std::sqrt(0.1 * 0.9 * count));
  for (size_t n = 0; n < observations.size(); ++n) {
    const bool is_outlier = outliers.count(static_cast<int64_t>(n)) > 0;
    EXPECT_EQ(observations[n].ErrorPx() > 1e-9, is_outlier) << n;
  }
}

TEST(SceneNoise, AddsTwinsInTheSameImageAndTrackAtMostTwoPixelsAway) {
  SceneOptions options;
  options.duplicate_ratio = 0.5;
  const SyntheticScene scene = SynthesizeScene(options);
  EXPECT_NO_THROW(ValidateModel(scene.model));
  std::set<std::pair<size_t, size_t>> seen;  // image, point
  double num_twins = 0;
  for (const auto& o : RecomputeObservations(scene.ground_truth)) {
    const bool is_twin = !seen.insert({o.image, o.point}).second;
    num_twins += is_twin;
    if (is_twin) {
      EXPECT_LE((o.projected - o.measured).cwiseAbs().maxCoeff(), 2 + 1e-9);
    } else {
      EXPECT_LT(o.ErrorPx(), 1e-9);
    }
  }
  const double count = static_cast<double>(seen.size());
  EXPECT_NEAR(num_twins, 0.5 * count, 5 * 0.5 * std::sqrt(count));
}

TEST(SceneNoise, OfTheStartKeepsRotationsAndPixels) {
  SceneOptions options;
  options.start_translation_noise = 0.05;
  options.start_point_noise = 0.05;
  options.pixel_noise = 1;
  const SyntheticScene scene = SynthesizeScene(options);
  EXPECT_TRUE(SamePixels(scene.model, scene.ground_truth));
  for (size_t j = 0; j < scene.model.images.size(); ++j) {
    const Pose& start = scene.model.images[j].cam_from_world;
    const Pose& truth = scene.ground_truth.images[j].cam_from_world;
    EXPECT_LT((start.Rotation() - truth.Rotation()).norm(), 1e-14);
    EXPECT_GT((start.translation - truth.translation).norm(), 1e-4);
  }
  EXPECT_GT(MaxErrorPx(scene.model), 10 * MaxErrorPx(scene.ground_truth));
}

TEST(SceneNoise, OfTheRotationsTurnsFramesByTheAngleAskedFor) {
  SceneOptions options;
  options.num_frames = 2000;
  options.rotation_noise_deg = 0.5;
  const SyntheticScene scene = SynthesizeScene(options);
  double sum2_deg = 0;
  for (size_t f = 0; f < scene.model.frames.size(); ++f) {
    const Eigen::Matrix3d R_start =
        scene.model.frames[f].rig_from_world.Rotation();
    const Eigen::Matrix3d R_truth =
        scene.ground_truth.frames[f].rig_from_world.Rotation();
    const double angle =
        Eigen::AngleAxisd(R_start * R_truth.transpose()).angle() * 180 /
        3.14159265358979323846;
    EXPECT_LE(angle, 3 * 0.5 + 1e-6);
    sum2_deg += angle * angle;
  }
  EXPECT_NEAR(std::sqrt(sum2_deg / 2000), 0.5, 0.05);
}

TEST(SceneNoise, HoweverStrongLeavesEveryDepthPositive) {
  for (const int camera_model_id : {1, 5, 7}) {
    for (const int sensors : {1, 4}) {
      SceneOptions options;
      options.camera_model_id = camera_model_id;
      options.focal_length_factor = 0.5;
      options.sensors_per_rig = sensors;
      options.rig_baseline = 0.2;
      options.start_translation_noise = 1;
      options.start_point_noise = 1;
      options.rotation_noise_deg = 3;
      const SyntheticScene scene = SynthesizeScene(options);
      EXPECT_GT(MinDepth(scene.model), 0);
    }
  }
}

TEST(SceneNoise, IsTheSameForTheSameSeedAndDiffersForAnother) {
  SceneOptions options;
  options.pixel_noise = 1;
  options.start_point_noise = 0.01;
  options.outlier_ratio = 0.05;
  options.random_seed = 7;
  const SyntheticScene scene = SynthesizeScene(options);
  const SyntheticScene same = SynthesizeScene(options);
  options.random_seed = 8;
  const SyntheticScene other = SynthesizeScene(options);
  EXPECT_TRUE(SamePixels(scene.model, same.model));
  EXPECT_EQ(scene.outliers, same.outliers);
  for (size_t k = 0; k < scene.model.points3D.size(); ++k) {
    EXPECT_EQ(scene.model.points3D[k].xyz, same.model.points3D[k].xyz);
  }
  EXPECT_FALSE(SamePixels(scene.model, other.model));
}

constexpr int kSamples = 200000;

TEST(Random, GivesTheNumbersFixedByTheStandard) {
  // The 10000th output of a default-seeded mt19937_64 is
  // 9981545732273789042 [rand.predef].
  Random random(std::mt19937_64::default_seed);
  for (int n = 1; n < 10000; ++n) random.Uniform();
  EXPECT_EQ(random.Uniform(),
            static_cast<double>(9981545732273789042u >> 11) * 0x1p-53);
}

TEST(Random, UniformHasMeanOneHalfAndStaysInItsInterval) {
  Random random(1);
  double sum = 0;
  for (int n = 0; n < kSamples; ++n) {
    const double x = random.Uniform();
    ASSERT_GE(x, 0);
    ASSERT_LT(x, 1);
    sum += x;
  }
  const double sigma_of_mean = 1 / std::sqrt(12.0 * kSamples);
  EXPECT_NEAR(sum / kSamples, 0.5, 5 * sigma_of_mean);
}

TEST(Random, UniformIntReachesEveryValueAndNoOther) {
  Random random(2);
  std::vector<int> counts(7, 0);
  for (int n = 0; n < kSamples; ++n) {
    ++counts.at(static_cast<size_t>(random.UniformInt(7)));
  }
  for (const int count : counts) {
    EXPECT_NEAR(count, kSamples / 7.0, 5 * std::sqrt(kSamples / 7.0));
  }
}

TEST(Random, GaussianHasTheMomentsOfTheNormalDistribution) {
  Random random(3);
  double sum = 0, sum2 = 0, sum4 = 0;
  for (int n = 0; n < kSamples; ++n) {
    const double x = random.Gaussian();
    sum += x;
    sum2 += x * x;
    sum4 += x * x * x * x;
  }
  // Five standard deviations of each sample moment (variances 1, 2, 96).
  const double root = std::sqrt(static_cast<double>(kSamples));
  EXPECT_NEAR(sum / kSamples, 0, 5 / root);
  EXPECT_NEAR(sum2 / kSamples, 1, 5 * std::sqrt(2.0) / root);
  EXPECT_NEAR(sum4 / kSamples, 3, 5 * std::sqrt(96.0) / root);
}

}  // namespace
}  // namespace krot::internal
