#include "krot/outliers/removal.h"

#include <algorithm>
#include <numeric>
#include <set>

#include <gtest/gtest.h>

#include "krot/convert/build_problem.h"
#include "krot/problem/subset.h"
#include "tests/oracle/lp_oracle.h"
#include "tests/outliers/outlier_scenes.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

constexpr double kConflictBound = 2;

std::vector<int64_t> All(const BuiltProblem& built) {
  std::vector<int64_t> all(built.pixels.size());
  std::iota(all.begin(), all.end(), 0);
  return all;
}

// The optimum of some observations, by linear programmes that know nothing of
// the library: the largest of those of their connected parts.
double OptimumByOracle(const KnownRotationProblem& problem, Norm norm,
                       const std::vector<int64_t>& observations) {
  double largest = 0;
  for (const std::vector<int64_t>& part : SplitIntoComponents(
           problem, PruneUnconstrained(problem, observations))) {
    const ProblemSubset subset(problem, part);
    largest = std::max(
        largest, *OptimalCostByBisection(subset.problem(), norm, 1000, 1e-3));
  }
  return largest;
}

bool HasOracle() {
  const SyntheticScene scene = MakeOutlierScene(1, 0);
  return OptimalCostByBisection(BuildProblem(scene.model, {}).problem,
                                Norm::LInf(), 1000, 1e-3)
      .has_value();
}

TEST(DisjointConflicts, AreInfeasibleAndIrreducibleByAnIndependentOracle) {
  if (!HasOracle()) GTEST_SKIP() << "built without CLP";
  for (const Norm norm : {Norm::LInf(), Norm::L1()}) {
    for (const uint64_t seed : {1u, 2u, 3u}) {
      SCOPED_TRACE(testing::Message() << "p = " << norm.p << ", " << seed);
      const SyntheticScene scene = MakeOutlierScene(seed, 0.03);
      const BuiltProblem built = BuildProblem(scene.model, {});
      const std::vector<Conflict> conflicts =
          DisjointConflicts(scene.model, built, {norm, kConflictBound});
      ASSERT_FALSE(conflicts.empty());
      for (const Conflict& conflict : conflicts) {
        EXPECT_TRUE(conflict.is_irreducible);
        EXPECT_GT(OptimumByOracle(built.problem, norm, conflict.observations),
                  kConflictBound);
        for (const int64_t spared : conflict.observations) {
          std::vector<int64_t> others = conflict.observations;
          others.erase(std::find(others.begin(), others.end(), spared));
          EXPECT_LE(OptimumByOracle(built.problem, norm, others),
                    kConflictBound * (1 + 1e-6));
        }
      }
    }
  }
}

// Scales that differ from one observation to the next.
std::vector<double> Scales(const BuiltProblem& built) {
  std::vector<double> scales;
  for (size_t i = 0; i < built.pixels.size(); ++i) {
    scales.push_back(0.5 + 0.1 * static_cast<double>(i * 7 % 6));
  }
  return scales;
}

TEST(DisjointConflicts, WithABoundForEachHoldByAnIndependentOracle) {
  if (!HasOracle()) GTEST_SKIP() << "built without CLP";
  const SyntheticScene scene = MakeOutlierScene(1, 0.12, 14, 0.3);
  BuiltProblem built = BuildProblem(scene.model, {});
  const std::vector<double> scales = Scales(built);
  KnownRotationProblem by_hand = built.problem;
  for (size_t i = 0; i < scales.size(); ++i) {
    by_hand.observations[i].E.bottomRows<2>() /= scales[i];
  }
  ScaleObservations(scales, &built);
  const std::vector<Conflict> conflicts =
      DisjointConflicts(scene.model, built, {Norm::LInf(), kConflictBound});
  ASSERT_GE(conflicts.size(), 2u);
  for (const Conflict& conflict : conflicts) {
    EXPECT_GT(OptimumByOracle(by_hand, Norm::LInf(), conflict.observations),
              kConflictBound);
  }
  // Two disjoint ones: whichever single observation goes, it is not enough.
  for (const int64_t gone : All(built)) {
    std::vector<int64_t> others = All(built);
    others.erase(others.begin() + gone);
    EXPECT_GT(OptimumByOracle(by_hand, Norm::LInf(), others), kConflictBound)
        << gone;
  }
}

TEST(DisjointConflicts, AreThoseOfTwiceTheBoundWhereAllScalesAreAHalf) {
  SceneOptions options = OutlierScene(5, 0.05, 60, 0.5);
  options.camera_model_id = 4;  // OPENCV
  const SyntheticScene scene = SynthesizeScene(options);
  BuiltProblem built = BuildProblem(scene.model, {});
  const std::vector<Conflict> plain =
      DisjointConflicts(scene.model, built, {Norm::L2(), kConflictBound});
  ScaleObservations(std::vector<double>(built.pixels.size(), 0.5), &built);
  const std::vector<Conflict> scaled =
      DisjointConflicts(scene.model, built, {Norm::L2(), 2 * kConflictBound});
  ASSERT_GT(plain.size(), 1u);
  ASSERT_EQ(scaled.size(), plain.size());
  for (size_t n = 0; n < plain.size(); ++n) {
    EXPECT_EQ(scaled[n].observations, plain[n].observations);
    EXPECT_NEAR(scaled[n].proof.lower_bound, 2 * plain[n].proof.lower_bound,
                1e-6);
  }
}

TEST(DisjointConflicts, HaveNoCommonObservationAndAnAcceptedProof) {
  for (const uint64_t seed : {4u, 5u}) {
    const SyntheticScene scene = MakeOutlierScene(seed, 0.05);
    const BuiltProblem built = BuildProblem(scene.model, {});
    const ErrorBound bound{Norm::L2(), kConflictBound};
    const std::vector<Conflict> conflicts =
        DisjointConflicts(scene.model, built, bound);
    ASSERT_FALSE(conflicts.empty());
    std::set<int64_t> seen;
    for (const Conflict& conflict : conflicts) {
      const PixelCertificateCheck check = CheckPixelCertificate(
          scene.model, built, bound.norm, conflict.proof, {});
      EXPECT_TRUE(check.is_accepted) << check.refusal;
      EXPECT_GT(check.lower_bound, kConflictBound);
      for (const int64_t i : conflict.observations) {
        EXPECT_TRUE(seen.insert(i).second) << "observation " << i;
      }
    }
    // Whatever is proved, the planted ones suffice.
    EXPECT_LE(conflicts.size(), scene.outliers.size());
  }
}

TEST(DisjointConflicts, AreNoneWhereEverythingFits) {
  const SyntheticScene scene = MakeOutlierScene(6, 0);
  const BuiltProblem built = BuildProblem(scene.model, {});
  EXPECT_TRUE(DisjointConflicts(scene.model, built, {Norm::L2(), 4}).empty());
}

// A camera that maps everything to one pixel says nothing about its points.
TEST(Decide, EndsSoonWhereNothingCanBeDecided) {
  Model model = MakeOutlierScene(1, 0.05).model;
  for (Camera& camera : model.cameras) {
    camera.params[0] = camera.params[1] = 0;
  }
  const BuiltProblem built = BuildProblem(model, {});
  ASSERT_FALSE(built.pixels.empty());
  Work work;
  const Decision decision =
      Decide(model, built, {Norm::L2(), kConflictBound}, {}, &work);
  EXPECT_FALSE(decision.is_feasible);
  EXPECT_FALSE(decision.is_refuted);
  EXPECT_LE(work.done, 500 * static_cast<int64_t>(built.pixels.size()));
}

TEST(FindConflict, OfAnImageTwiceInATrackIsThePair) {
  SceneOptions options = SceneOf(5, 40, 4);
  options.duplicate_ratio = 0.2;
  options.random_seed = 7;
  Model model = SynthesizeScene(options).model;
  const BuiltProblem built = BuildProblem(model, {});
  // Without noise, nothing but a twin is above a tenth of a pixel.
  int num_pairs = 0;
  const KnownRotationProblem& problem = built.problem;
  for (int32_t k = 0; k < problem.num_points; ++k) {
    std::vector<int64_t> track(problem.point_begin[k + 1] -
                               problem.point_begin[k]);
    std::iota(track.begin(), track.end(), problem.point_begin[k]);
    Work work;
    const std::optional<Conflict> conflict =
        FindConflict(model, built, {Norm::L2(), 0.1}, track, {}, &work);
    if (!conflict) continue;
    ++num_pairs;
    ASSERT_EQ(conflict->observations.size(), 2u);
    EXPECT_EQ(problem.observations[conflict->observations[0]].view,
              problem.observations[conflict->observations[1]].view);
  }
  EXPECT_GT(num_pairs, 5);
}

}  // namespace
}  // namespace krot::internal
