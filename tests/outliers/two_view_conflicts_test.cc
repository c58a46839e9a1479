
#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "krot/outliers/conflict.h"
#include "krot/outliers/removal.h"
#include "tests/outliers/outlier_scenes.h"

namespace krot::internal {
namespace {

constexpr double kTwoViewBound = 2;

struct Charged {
  explicit Charged(uint64_t seed)
      : scene(MakeOutlierScene(seed, 0.05)),
        built(BuildProblem(scene.model, {})),
        removal(
            FindRemoval(scene.model, built, {Norm::L2(), kTwoViewBound}, {})),
        worth(built.pixels.size(), 1) {
    for (const int64_t i : removal.observations) worth[i] = 0;
  }

  int32_t ViewOf(int64_t i) const { return built.problem.observations[i].view; }

  const SyntheticScene scene;
  const BuiltProblem built;
  const Removal removal;
  std::vector<float> worth;
};

TEST(TwoViewConflicts, CandidatesDoNotGoTogetherByTheSolver) {
  int num_candidates = 0;
  for (const uint64_t seed : {1u, 2u, 3u}) {
    const Charged c(seed);
    const TwoViewConflicts conflicts(c.built.problem, c.removal.estimate,
                                     kTwoViewBound);
    for (const int64_t i : c.removal.observations) {
      for (const std::vector<int64_t>& set : conflicts.Candidates(i, c.worth)) {
        ++num_candidates;
        Work work;
        EXPECT_TRUE(FindConflict(c.scene.model, c.built,
                                 {Norm::L2(), kTwoViewBound}, set, {}, &work))
            << "observation " << i << ", seed " << seed;
      }
    }
  }
  EXPECT_GT(num_candidates, 50);
}

TEST(TwoViewConflicts, CandidatesAreOfTwoViewsAndOfWhatMayBeUsed) {
  Charged c(4);
  for (size_t i = 0; i < c.worth.size(); i += 3) c.worth[i] = 0;
  const TwoViewConflicts conflicts(c.built.problem, c.removal.estimate,
                                   kTwoViewBound);
  size_t num_candidates = 0;
  for (const int64_t i : c.removal.observations) {
    for (const std::vector<int64_t>& set : conflicts.Candidates(i, c.worth)) {
      ++num_candidates;
      EXPECT_TRUE(std::is_sorted(set.begin(), set.end()));
      std::set<int32_t> views;
      for (const int64_t j : set) {
        views.insert(c.ViewOf(j));
        EXPECT_TRUE(j == i || c.worth[j] > 0);
      }
      EXPECT_EQ(views.size(), 2u);
      EXPECT_TRUE(std::binary_search(set.begin(), set.end(), i));
    }
  }
  EXPECT_GT(num_candidates, 0u);
}

TEST(TwoViewConflicts, HasNoCandidateForWhatIsWithinTheBound) {
  const Charged c(5);
  const TwoViewConflicts conflicts(c.built.problem, c.removal.estimate,
                                   kTwoViewBound);
  for (int64_t i = 0; i < static_cast<int64_t>(c.worth.size()); ++i) {
    if (c.worth[i] == 0) continue;
    EXPECT_TRUE(conflicts.Candidates(i, c.worth).empty());
  }
}

}  // namespace
}  // namespace krot::internal
