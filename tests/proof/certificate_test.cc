#include "krot/proof/certificate.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/joint/joint.h"
#include "krot/problem/cost.h"
#include "krot/proof/dual_repair.h"
#include "tests/problem/random_problem.h"
#include "tests/verify/joint_iterate.h"
#include "tests/verify/naive_certificate_check.h"

namespace krot::internal {
namespace {

RandomScene MakeScene(unsigned seed, int views_per_frame, double baseline) {
  RandomSceneOptions options = {5, 40, views_per_frame, baseline};
  options.seed = seed;
  return MakeRandomScene(options);
}

class CertificateOfNorm : public ::testing::TestWithParam<double> {
 protected:
  Norm norm() const { return {GetParam()}; }

  // With what it proves compared to the cost.
  std::optional<Certificate> ProveOptimum(const RandomScene& scene) const {
    const JointIterate iterate =
        SolveToGap(scene.problem, norm(), scene.estimate, 1e-7);
    const double cost = Cost(scene.problem, iterate.estimate, norm(), 1);
    const std::optional<Certificate> certificate =
        Certify(scene.problem, norm(), iterate);
    if (!certificate) return std::nullopt;
    EXPECT_LE(certificate->lower_bound * (1 - certificate->defect), cost);
    EXPECT_GE(certificate->lower_bound, cost * (1 - 1e-6));
    return certificate;
  }
};

TEST_P(CertificateOfNorm, ProvesTheOptimumAndAStrangerAgrees) {
  for (unsigned seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE(seed);
    const RandomScene scene = MakeScene(seed, 1, 0);
    const std::optional<Certificate> certificate = ProveOptimum(scene);
    ASSERT_TRUE(certificate);
    EXPECT_TRUE(
        CheckCertificate(scene.problem, norm(), *certificate).is_accepted);

    const NaiveCheck naive =
        CheckNaively(scene.problem, GetParam(), *certificate);
    EXPECT_LE(naive.longest, 1 + 1e-12);
    EXPECT_LE(naive.term, 1e-6);
  }
}

TEST_P(CertificateOfNorm, ProvesTheOptimumOfRigsWithBaselines) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    const RandomScene scene = MakeScene(seed, 2, 0.3);
    const std::optional<Certificate> certificate = ProveOptimum(scene);
    ASSERT_TRUE(certificate);
  }
}

TEST_P(CertificateOfNorm, NeedsNoMoreThanARoughIterate) {
  const RandomScene scene = MakeScene(1, 1, 0);
  const std::optional<Certificate> rough =
      Certify(scene.problem, norm(),
              SolveToGap(scene.problem, norm(), scene.estimate, 1e-3));
  const std::optional<Certificate> fine =
      Certify(scene.problem, norm(),
              SolveToGap(scene.problem, norm(), scene.estimate, 1e-8));
  ASSERT_TRUE(rough);
  ASSERT_TRUE(fine);
  EXPECT_NEAR(rough->lower_bound, fine->lower_bound, 1e-4 * fine->lower_bound);
}

TEST_P(CertificateOfNorm, ProvesThatNothingIsJustBelowTheOptimum) {
  for (const double baseline : {0.0, 0.3}) {
    const RandomScene scene = MakeScene(5, baseline > 0 ? 2 : 1, baseline);
    const JointIterate iterate =
        SolveToGap(scene.problem, norm(), scene.estimate, 1e-7);
    const double cost = Cost(scene.problem, iterate.estimate, norm(), 1);
    for (const double share : {0.5, 0.9, 0.999}) {
      SCOPED_TRACE(testing::Message() << baseline << ", share " << share);
      FeasibleStartOptions options;
      options.norm = norm();
      options.hopeless_gap = 1e-5;
      options.unit_depth = 0.5;
      Estimate unused;
      std::vector<Multiplier> multipliers;
      ASSERT_NE(FindEstimateBelow(scene.problem, share * cost, options, {},
                                  &unused, &multipliers),
                InteriorPointTermination::kFeasible);
      const std::optional<Certificate> certificate =
          MakeInfeasibilityCertificate(scene.problem, norm(), share * cost,
                                       multipliers, CertificateOptions(), {});
      ASSERT_TRUE(certificate);
      const CertificateCheck check =
          CheckCertificate(scene.problem, norm(), *certificate);
      EXPECT_TRUE(check.is_accepted) << check.refusal;
      EXPECT_GE(check.proved_bound, (1 - 1e-3) * share * cost);
      EXPECT_LE(check.proved_bound, cost);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(P, CertificateOfNorm,
                         ::testing::Values(1.0, 2.0, INFINITY),
                         [](const auto& test) {
                           return std::isinf(test.param)
                                      ? std::string("Inf")
                                      : std::to_string(
                                            static_cast<int>(test.param));
                         });

TEST(MakeCertificate, ReachesAndNeverExceedsAnOptimumThatIsKnownExactly) {
  // One image sees one point twice, 16 px apart; nothing else is as bad.
  RandomScene scene = MakeScene(2, 1, 0);
  Observation twin = scene.problem.observations.back();
  twin.E = RowAtRay(RayOf(twin), 1024 * Eigen::Matrix2d::Identity());
  scene.problem.observations.back() = twin;
  MoveRay({1.0 / 64, 0}, &twin);
  scene.problem.observations.push_back(twin);
  IndexObservations(&scene.problem);
  const std::optional<Certificate> certificate =
      Certify(scene.problem, Norm::L2(),
              SolveToGap(scene.problem, Norm::L2(), scene.estimate, 1e-7));
  ASSERT_TRUE(certificate);
  EXPECT_EQ(certificate->observations.size(), 2u);
  EXPECT_LE(certificate->lower_bound * (1 - certificate->defect), 8);
  EXPECT_GE(certificate->lower_bound, 8 * (1 - 1e-9));
}

TEST(SelectBalanced, FindsASupportAmongForcesThatDoNotBalance) {
  const RandomScene scene = MakeScene(1, 1, 0);
  const std::optional<Certificate> certificate =
      Certify(scene.problem, Norm::L2(),
              SolveToGap(scene.problem, Norm::L2(), scene.estimate, 1e-7));
  ASSERT_TRUE(certificate);
  std::vector<Multiplier> multipliers(scene.problem.observations.size());
  std::vector<int64_t> all;
  double smallest = INFINITY;
  for (const CertifiedObservation& o : certificate->observations) {
    smallest = std::min(smallest, o.lambda);
  }
  for (Multiplier& m : multipliers) {
    m.lambda = 1e-6 * smallest;
    all.push_back(static_cast<int64_t>(all.size()));
  }
  std::vector<int64_t> support;
  for (const CertifiedObservation& o : certificate->observations) {
    multipliers[o.observation] = {o.lambda, o.y};
    support.push_back(o.observation);
  }
  // What is small beside it at its points does no harm; all else is dropped.
  std::set<int32_t> points;
  for (const int64_t i : support) {
    points.insert(scene.problem.observations[i].point);
  }
  const std::vector<int64_t> balanced = SelectBalanced(
      scene.problem, certificate->lower_bound, multipliers, all, 1e-2);
  EXPECT_THAT(balanced, testing::IsSupersetOf(support));
  for (const int64_t i : balanced) {
    EXPECT_EQ(points.count(scene.problem.observations[i].point), 1u);
  }
  // Without one of its observations nothing of it balances.
  support.pop_back();
  EXPECT_THAT(SelectBalanced(scene.problem, certificate->lower_bound,
                             multipliers, support, 1e-2),
              testing::IsEmpty());
}

// What sets the maximum may be too much to be found among what comes close.
TEST_P(CertificateOfNorm, ComesOfAllMultipliersAtOnce) {
  for (unsigned seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE(seed);
    const RandomScene scene = MakeScene(seed, 2, 0.3);
    const JointIterate iterate =
        SolveToGap(scene.problem, norm(), scene.estimate, 1e-3);
    const std::optional<Certificate> certificate = RepairCertificate(
        scene.problem, norm(), iterate.estimate, iterate.multipliers, {}, {});
    ASSERT_TRUE(certificate);
    const CertificateCheck check =
        CheckCertificate(scene.problem, norm(), *certificate);
    EXPECT_TRUE(check.is_accepted);
    const double cost = Cost(scene.problem, iterate.estimate, norm(), 1);
    EXPECT_GE(check.proved_bound, (1 - 2e-3) * cost);
  }
}

TEST(RepairMultipliers, EndsWithTheFirstThatAreSufficient) {
  const RandomScene scene = MakeScene(1, 2, 0.3);
  const JointIterate iterate =
      SolveToGap(scene.problem, Norm::L2(), scene.estimate, 0.1);
  const double delta =
      SuggestedBound(scene.problem, iterate.estimate, iterate.multipliers);
  const std::optional<Certificate> best =
      RepairMultipliers(scene.problem, Norm::L2(), delta, iterate.multipliers);
  ASSERT_TRUE(best);
  RepairOptions options;
  options.sufficient_bound = 0.5 * best->lower_bound;
  const std::optional<Certificate> first = RepairMultipliers(
      scene.problem, Norm::L2(), delta, iterate.multipliers, options);
  ASSERT_TRUE(first);
  EXPECT_GE(first->lower_bound, options.sufficient_bound);
  EXPECT_LT(first->lower_bound, best->lower_bound);
}

TEST(SelectForFrames, KeepsPointsWholeAndOfAllFramesEnough) {
  const RandomScene scene = MakeScene(1, 2, 0.3);
  const std::vector<Multiplier> multipliers =
      SolveToGap(scene.problem, Norm::L2(), scene.estimate, 1e-2).multipliers;
  size_t num_before = scene.problem.observations.size() + 1;
  for (const double share : {0.0, 0.01, 0.1, 0.5}) {
    SCOPED_TRACE(share);
    const std::vector<int64_t> selected =
        SelectForFrames(scene.problem, multipliers, share);
    EXPECT_LT(selected.size(), num_before);
    num_before = selected.size();
    std::set<int64_t> is_selected(selected.begin(), selected.end());
    std::vector<double> lost(scene.problem.num_frames, 0);
    std::vector<double> all(scene.problem.num_frames, 0);
    for (size_t i = 0; i < multipliers.size(); ++i) {
      const Observation& o = scene.problem.observations[i];
      const int32_t frame = scene.problem.views[o.view].frame;
      all[frame] += multipliers[i].lambda;
      EXPECT_EQ(is_selected.count(static_cast<int64_t>(i)),
                is_selected.count(scene.problem.point_begin[o.point]));
      if (is_selected.count(static_cast<int64_t>(i)) == 0) {
        lost[frame] += multipliers[i].lambda;
      }
    }
    for (int32_t f = 0; f < scene.problem.num_frames; ++f) {
      EXPECT_LE(lost[f], share * all[f] * (1 + 1e-12));
    }
  }
}

TEST(MakeCertificate, GivesNoneFromMultipliersThatMeanNothing) {
  const RandomScene scene = MakeScene(1, 1, 0);
  JointIterate iterate;
  iterate.estimate = scene.estimate;
  iterate.gamma = 2 * Cost(scene.problem, scene.estimate, Norm::L2(), 1);
  iterate.multipliers.resize(scene.problem.observations.size());
  // All zero: no observation is in any support.
  EXPECT_FALSE(Certify(scene.problem, Norm::L2(), iterate));
}

TEST(MakeCertificate, KeepsWithinTheUnknownsItIsGranted) {
  const RandomScene scene = MakeScene(1, 1, 0);
  CertificateOptions options;
  options.max_unknowns = 2;
  EXPECT_FALSE(Certify(
      scene.problem, Norm::L2(),
      SolveToGap(scene.problem, Norm::L2(), scene.estimate, 1e-6), options));
}

TEST(MakeCertificate, RefusesAnIterateOfAnotherProblem) {
  const RandomScene scene = MakeScene(1, 1, 0);
  JointIterate iterate;
  iterate.estimate = scene.estimate;
  EXPECT_THROW(Certify(scene.problem, Norm::L2(), iterate),
               std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
