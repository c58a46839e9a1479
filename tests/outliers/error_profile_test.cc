#include "krot/outliers/outlier_filter.h"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/convert/reprojection.h"
#include "krot/problem/subset.h"
#include "tests/oracle/lp_oracle.h"
#include "tests/outliers/outlier_scenes.h"

namespace krot::internal {
namespace {

std::vector<int64_t> Kept(const BuiltProblem& built,
                          const ProfileLevel& level) {
  std::vector<int64_t> all(built.pixels.size());
  std::iota(all.begin(), all.end(), 0);
  const std::vector<int64_t>& removed = level.removal.observations;
  std::vector<int64_t> kept;
  std::set_difference(all.begin(), all.end(), removed.begin(), removed.end(),
                      std::back_inserter(kept));
  return PruneUnconstrained(built.problem, kept);
}

TEST(ErrorProfile, OfEveryLevelBothEndsAreCheckedAnew) {
  for (const uint64_t seed : {1u, 2u}) {
    const SyntheticScene scene = MakeOutlierScene(seed, 0.02, 150);
    const BuiltProblem built = BuildProblem(scene.model, {});
    const Norm norm = Norm::L2();
    const ErrorProfile profile =
        FindErrorProfile(scene.model, built, {norm, 2.0}, {});
    const Reprojection reprojection(scene.model, built);
    ASSERT_GE(profile.levels.size(), 3u);
    for (const ProfileLevel& level : profile.levels) {
      const std::vector<int64_t> kept = Kept(built, level);
      for (const int64_t i : kept) {
        EXPECT_LE(reprojection.Error(level.removal.estimate, norm, i),
                  level.max_error);
      }
      ASSERT_TRUE(level.proof);
      const PixelCertificateCheck check =
          CheckPixelCertificate(scene.model, built, norm, *level.proof, {});
      EXPECT_TRUE(check.is_accepted) << check.refusal;
      EXPECT_EQ(check.lower_bound, level.lower_bound);
      EXPECT_GE(level.lower_bound, (1 - 2e-3) * level.max_error);
      for (const CertifiedObservation& o : level.proof->rows.observations) {
        EXPECT_TRUE(
            std::binary_search(kept.begin(), kept.end(), o.observation));
      }
    }
  }
}

TEST(ErrorProfile, RemovesMoreForLessFromLevelToLevelDownToTheLast) {
  const SyntheticScene scene = MakeOutlierScene(3, 0.02, 150);
  const BuiltProblem built = BuildProblem(scene.model, {});
  const ErrorProfile profile =
      FindErrorProfile(scene.model, built, {Norm::L2(), 2.0}, {});
  const std::vector<ProfileLevel>& levels = profile.levels;
  EXPECT_TRUE(levels.front().removal.observations.empty());
  EXPECT_LE(levels.back().max_error, 2);
  for (size_t n = 1; n < levels.size(); ++n) {
    EXPECT_GT(levels[n].removal.observations.size(),
              levels[n - 1].removal.observations.size());
    EXPECT_LT(levels[n].max_error, levels[n - 1].max_error);
    EXPECT_GE(levels[n].num_proved, levels[n - 1].num_proved);
  }
}

TEST(ErrorProfile, ProvesByDisjointConflictsAboveTheLevel) {
  const SyntheticScene scene = MakeOutlierScene(4, 0.02, 150);
  const BuiltProblem built = BuildProblem(scene.model, {});
  const ErrorProfile profile =
      FindErrorProfile(scene.model, built, {Norm::L2(), 2.0}, {});
  std::set<int64_t> seen;
  for (const Conflict& conflict : profile.conflicts) {
    EXPECT_TRUE(CheckPixelCertificate(scene.model, built, Norm::L2(),
                                      conflict.proof, {})
                    .is_accepted);
    for (const int64_t i : conflict.observations) {
      EXPECT_TRUE(seen.insert(i).second);
    }
  }
  EXPECT_GT(profile.levels.back().num_proved, 0);
  for (const ProfileLevel& level : profile.levels) {
    ASSERT_LE(level.num_proved, static_cast<int64_t>(profile.conflicts.size()));
    EXPECT_LE(level.num_proved,
              static_cast<int64_t>(level.removal.observations.size()));
    for (int64_t n = 0; n < level.num_proved; ++n) {
      EXPECT_GT(profile.conflicts[n].proof.lower_bound, level.max_error);
    }
  }
}

TEST(ErrorProfile, HasTheOptimaOfAnIndependentOracle) {
  const SyntheticScene scene = MakeOutlierScene(5, 0.03, 40);
  const BuiltProblem built = BuildProblem(scene.model, {});
  for (const Norm norm : {Norm::LInf(), Norm::L1()}) {
    const ErrorProfile profile =
        FindErrorProfile(scene.model, built, {norm, 2.0}, {});
    ASSERT_FALSE(profile.levels.empty());
    for (const ProfileLevel& level : profile.levels) {
      double largest = 0;
      for (const std::vector<int64_t>& part :
           SplitIntoComponents(built.problem, Kept(built, level))) {
        const ProblemSubset subset(built.problem, part);
        const std::optional<double> cost =
            OptimalCostByBisection(subset.problem(), norm, 1000, 1e-3);
        if (!cost) GTEST_SKIP() << "built without CLP";
        largest = std::max(largest, *cost);
      }
      EXPECT_LE(level.lower_bound, largest + 1e-3);
      EXPECT_GE(level.max_error, largest - 1e-3);
    }
  }
}

NoiseLimit LimitOf(const Model& model) {
  return FindNoiseLimit(model, BuildProblem(model, {}), Norm::L2(), {});
}

TEST(NoiseLimit, HasTheSigmaOfAnAdjustedModelWhateverTheLengthOfItsTracks) {
  for (const double track_length : {3.0, 5.0, 8.0}) {
    SCOPED_TRACE(track_length);
    SceneOptions options = OutlierScene(6, 0, 400, 0.7);
    options.num_frames = 10;
    options.track_length = track_length;
    const Model adjusted =
        AdjustBundle(SynthesizeScene(options).model, {}, {}).model;
    EXPECT_NEAR(LimitOf(adjusted).sigma, 0.7, 0.1);
  }
}

// Nor where cameras, points or a share of the observations are far off.
TEST(NoiseLimit, DoesNotMindOutliersOrAStartThatIsOff) {
  for (const double start_noise : {0.0, 0.03}) {
    for (const double outlier_ratio : {0.0, 0.1}) {
      SCOPED_TRACE(testing::Message() << start_noise << ' ' << outlier_ratio);
      SceneOptions options = OutlierScene(6, outlier_ratio, 150, 1);
      options.start_translation_noise = start_noise;
      options.start_point_noise = start_noise;
      const NoiseLimit limit = LimitOf(SynthesizeScene(options).model);
      EXPECT_GT(limit.sigma, 0.7);
      EXPECT_LT(limit.sigma, 1.5);
    }
  }
}

TEST(ErrorProfile, BendsWherePlantedOutliersAreGone) {
  for (const double start_noise : {0.0, 0.03}) {
    SceneOptions options = OutlierScene(6, 0.02, 150, 0.2);
    options.start_translation_noise = start_noise;
    options.start_point_noise = start_noise;
    const SyntheticScene scene = SynthesizeScene(options);
    const BuiltProblem built = BuildProblem(scene.model, {});
    const ErrorProfile profile =
        FindErrorProfile(scene.model, built, {Norm::L2(), {}}, {});
    ASSERT_TRUE(profile.elbow);
    const ProfileLevel& elbow = profile.levels[*profile.elbow];
    EXPECT_LE(elbow.max_error, profile.noise.max_error);
    EXPECT_GT(profile.levels[*profile.elbow - 1].max_error,
              profile.noise.max_error);
    // Of all but those that happen to fall near their place.
    EXPECT_LT(elbow.max_error, 2);
    EXPECT_LE(elbow.removal.observations.size(), scene.outliers.size());
    EXPECT_GE(elbow.removal.observations.size(),
              0.9 * static_cast<double>(scene.outliers.size()));
    EXPECT_LE(profile.levels.back().max_error,
              0.5 * profile.levels[0].max_error);
  }
}

TEST(ErrorProfile, HasNoElbowInGaussianNoise) {
  for (const double track_length : {2.5, 4.0, 6.0}) {
    for (const uint64_t seed : {1u, 2u, 3u}) {
      SceneOptions options = OutlierScene(seed, 0, 150, 1);
      options.track_length = track_length;
      const Model model = SynthesizeScene(options).model;
      const ErrorProfile profile = FindErrorProfile(
          model, BuildProblem(model, {}), {Norm::L2(), {}}, {});
      EXPECT_FALSE(profile.elbow) << track_length << ", " << seed;
      EXPECT_GT(profile.levels.size(), 3u);
    }
  }
}

TEST(ErrorProfile, HasNoElbowInRounding) {
  const Model model = MakeOutlierScene(6, 0, 150, 0).model;
  const ErrorProfile profile =
      FindErrorProfile(model, BuildProblem(model, {}), {Norm::L2(), {}}, {});
  EXPECT_FALSE(profile.elbow);
}

TEST(ErrorProfile, EndsWithTheFirstLevelWhereThatIsLowEnough) {
  const SyntheticScene scene = MakeOutlierScene(7, 0);
  const BuiltProblem built = BuildProblem(scene.model, {});
  const ErrorProfile profile =
      FindErrorProfile(scene.model, built, {Norm::L2(), 10.0}, {});
  EXPECT_EQ(profile.levels.size(), 1u);
  EXPECT_FALSE(profile.elbow);
}

}  // namespace
}  // namespace krot::internal
