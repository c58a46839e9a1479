#include "krot/outliers/removal.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "krot/convert/reprojection.h"
#include "krot/outliers/conflict.h"
#include "tests/outliers/outlier_scenes.h"

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

}  // namespace
}  // namespace krot::internal
