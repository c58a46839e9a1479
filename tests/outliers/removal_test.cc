#include "krot/outliers/removal.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "krot/bridge/reprojection.h"
#include "krot/outliers/packing.h"
#include "tests/outliers/outlier_scenes.h"

namespace krot {
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
        PackAgainstRemoval(scene.model, built, bound, removal, {}, {});
    EXPECT_LE(conflicts.size(), scene.outliers.size());
    EXPECT_LE(conflicts.size(), removal.observations.size());
    EXPECT_GE(2 * conflicts.size(), removal.observations.size());
    EXPECT_LE(removal.observations.size(), scene.outliers.size());
  }
}

TEST(FindRemoval, NeedsNothingWhereEverythingFits) {
  const SyntheticScene scene = MakeOutlierScene(9, 0);
  const BuiltProblem built = BuildProblem(scene.model, {});
  EXPECT_TRUE(FindRemoval(scene.model, built, {Norm::L2(), 5}, {})
                  .observations.empty());
}

}  // namespace
}  // namespace krot
