#include "krot/outliers/removal.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "krot/convert/reprojection.h"
#include "tests/outliers/outlier_scenes.h"
#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

constexpr double kBound = 2;

TEST(FindRemoval, LeavesEveryOtherErrorWithinTheBound) {
  for (const uint64_t seed : {1u, 2u, 3u}) {
    const SyntheticScene scene = MakeOutlierScene(seed, 0.05, 200);
    const BuiltProblem built = BuildProblem(scene.model, {});
    const Removal removal =
        FindRemoval(scene.model, built, {Norm::L2(), kBound}, {});
    const Reprojection reprojection(scene.model, built);
    for (size_t i = 0; i < built.pixels.size(); ++i) {
      const int64_t observation = static_cast<int64_t>(i);
      if (std::binary_search(removal.observations.begin(),
                             removal.observations.end(), observation)) {
        continue;
      }
      EXPECT_LE(reprojection.Error(removal.estimate, Norm::L2(), observation),
                kBound);
    }
  }
}

// The bracket: what is proved, what would do (the planted ones), what is
// removed.
TEST(FindRemoval, AndWhatIsProvedEncloseTheNumberOfPlantedOutliers) {
  for (const double ratio : {0.002, 0.01, 0.05}) {
    SCOPED_TRACE(ratio);
    const SyntheticScene scene = MakeOutlierScene(8, ratio, 150);
    const BuiltProblem built = BuildProblem(scene.model, {});
    const ErrorBound bound{Norm::L2(), 3};
    const Removal removal = FindRemoval(scene.model, built, bound, {});
    const std::vector<Conflict> conflicts =
        PackAgainstRemoval(scene.model, built, bound, removal, {}, {})
            .conflicts;
    EXPECT_LE(conflicts.size(), scene.outliers.size());
    EXPECT_LE(conflicts.size(), removal.observations.size());
    EXPECT_GE(2 * conflicts.size(), removal.observations.size());
    EXPECT_LE(removal.observations.size(), scene.outliers.size());
  }
}

// With as little work as it may take, it says so, and what it found holds and
// is the same at any number of threads.
TEST(PackAgainstRemoval, EndsWithTheConflictsSoFarWhereItsWorkIsUsedUp) {
  const SyntheticScene scene = MakeOutlierScene(8, 0.05, 150);
  const BuiltProblem built = BuildProblem(scene.model, {});
  const ErrorBound bound{Norm::L2(), 3};
  const Removal removal = FindRemoval(scene.model, built, bound, {});
  const auto pack = [&](int64_t work_per_observation, int num_threads) {
    return PackAgainstRemoval(scene.model, built, bound, removal, {},
                              Context{num_threads}, work_per_observation);
  };
  const ConflictPacking whole = pack(1500, 2);
  EXPECT_TRUE(whole.is_complete);
  const ConflictPacking part = pack(1, 1);
  EXPECT_FALSE(part.is_complete);
  EXPECT_GT(part.conflicts.size(), 0u);
  EXPECT_LT(part.conflicts.size(), whole.conflicts.size());
  for (const Conflict& conflict : part.conflicts) {
    EXPECT_TRUE(CheckPixelCertificate(scene.model, built, bound.norm,
                                      conflict.proof, {})
                    .is_accepted);
  }
  const ConflictPacking by_two = pack(1, 2);
  ASSERT_EQ(by_two.conflicts.size(), part.conflicts.size());
  for (size_t n = 0; n < part.conflicts.size(); ++n) {
    EXPECT_EQ(by_two.conflicts[n].observations, part.conflicts[n].observations);
  }
}

TEST(FindRemoval, NeedsNothingWhereEverythingFits) {
  const SyntheticScene scene = MakeOutlierScene(9, 0);
  const BuiltProblem built = BuildProblem(scene.model, {});
  EXPECT_TRUE(FindRemoval(scene.model, built, {Norm::L2(), 5}, {})
                  .observations.empty());
}

TEST(RemoveChancePairs, TakesTheLastTwoOfTracksOfWhichMoreWent) {
  Model model;
  std::vector<char> is_removed;
  for (const std::vector<char>& track : std::vector<std::vector<char>>{
           {0, 1, 1, 0}, {0, 1, 1, 1, 0}, {0, 0, 1, 1, 1, 1, 0}, {0, 0}}) {
    Point3D& point = model.points3D.emplace_back();
    point.track_begin = is_removed.size();
    is_removed.insert(is_removed.end(), track.begin(), track.end());
    point.track_end = is_removed.size();
  }
  RemoveChancePairs(model, &is_removed);
  EXPECT_EQ(is_removed, std::vector<char>({0, 1, 1, 0, 1, 1, 1, 1, 1, 0, 0, 1,
                                           1, 1, 1, 0, 0, 0}));
}

constexpr double kLevel = 1;

KnownRotationProblem MakeProblem() {
  RandomSceneOptions options = {12, 80};
  options.seed = 3;
  return MakeRandomScene(options).problem;
}

int64_t CountOfPoint(const KnownRotationProblem& problem, const NearSet& set,
                     int32_t k) {
  int64_t count = 0;
  for (int64_t i = problem.point_begin[k]; i < problem.point_begin[k + 1];
       ++i) {
    count += set.Contains(i);
  }
  return count;
}

TEST(NearSet, TiesEveryPointThatItHasAndEveryFrame) {
  const KnownRotationProblem problem = MakeProblem();
  std::vector<double> errors(problem.observations.size(), kLevel / 2);
  errors[17] = 2 * kLevel;
  NearSet set(problem);
  set.AddAbove(errors, kLevel);
  EXPECT_TRUE(set.Contains(17));
  for (int32_t k = 0; k < problem.num_points; ++k) {
    const int64_t count = CountOfPoint(problem, set, k);
    const int64_t length = problem.point_begin[k + 1] - problem.point_begin[k];
    if (count > 0) {
      EXPECT_GE(count, std::min<int64_t>(length, 3));
    }
  }
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    int64_t count = 0;
    for (int64_t n = problem.frame_begin[f]; n < problem.frame_begin[f + 1];
         ++n) {
      count += set.Contains(problem.frame_observations[n]);
    }
    EXPECT_GE(count, 6);
  }
}

TEST(NearSet, KeepsWhatItHasAndHasEverythingThatWasEverAbove) {
  const KnownRotationProblem problem = MakeProblem();
  const size_t count = problem.observations.size();
  NearSet set(problem);
  for (size_t above = 0; above < count; ++above) {
    std::vector<double> errors(count, 0.0);
    errors[above] = 2 * kLevel;
    set.AddAbove(errors, kLevel);
    for (size_t i = 0; i <= above; ++i) {
      EXPECT_TRUE(set.Contains(static_cast<int64_t>(i)));
    }
  }
  size_t in_parts = 0;
  for (const std::vector<int64_t>& part : set.Parts()) in_parts += part.size();
  EXPECT_EQ(in_parts, count);
}

}  // namespace
}  // namespace krot::internal
