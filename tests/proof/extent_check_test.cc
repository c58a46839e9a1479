#include "krot/proof/extent_check.h"

#include <functional>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using ::testing::HasSubstr;

// Two unturned cameras, 1 apart along x, see one point at rays of slopes a and
// -a, to e = bound / focal at most; or one camera sees two such points. Then no
// depth is above 1 / 2(a - e). Of y_i = +-(1 - eta) lambda along x, the rest of
// both rows cancels but for 2 lambda ((a - e) w - 1 / 2), times the focal
// length.
constexpr double kFocal = 1000;  // pixels
constexpr double kSlope = 0.125;
constexpr double kBound = 5;  // pixels
constexpr double kEta = 1e-9;
constexpr double kTrueDepth = 0.5 / (kSlope - kBound / kFocal);

struct ByHand {
  KnownRotationProblem problem;
  ExtentCertificate certificate;
  double truth = 0;
};

View ViewAt(const Vector3d& cam_from_rig_translation, int32_t frame) {
  return {Matrix3d::Identity(), Matrix3d::Identity(), cam_from_rig_translation,
          frame};
}

Observation AtSlope(double slope, int32_t view, int32_t point) {
  return {RowAtRay({slope, 0}, kFocal * Eigen::Matrix2d::Identity()), view,
          point};
}

// The multipliers that press from the left at the first observation, from the
// right at the second.
ExtentCertificate Pressed(const Pull& pull) {
  const double y = 1 - kEta;
  const double lambda = 0.5 / (kSlope * kFocal * y - kBound);
  return {kBound,
          {pull},
          {{0, lambda, {y * lambda, 0}}, {1, lambda, {-y * lambda, 0}}}};
}

// How far the point can be from two cameras that stand at `origin` and beside
// it.
ByHand FarthestPoint(const Vector3d& origin) {
  ByHand hand;
  KnownRotationProblem& problem = hand.problem;
  problem.num_frames = 2;
  problem.num_points = 1;
  problem.views = {ViewAt({3, 4, 5}, 0), ViewAt(Vector3d::Zero(), 1)};
  problem.fixed_translations = {-origin - Vector3d(3, 4, 5),
                                -origin - Vector3d(1, 0, 0)};
  problem.observations = {AtSlope(kSlope, 0, 0), AtSlope(-kSlope, 1, 0)};
  IndexObservations(&problem);
  hand.certificate = Pressed({Pull::Kind::kPoint, 0, {0, 0, 1}});
  hand.truth = origin.z() + kTrueDepth;
  return hand;
}

// How far back the camera can be from two points, the first at `origin`; a
// second camera in its frame, `baseline` beside it, may see the other.
ByHand FarthestCamera(const Vector3d& origin, double baseline) {
  ByHand hand;
  KnownRotationProblem& problem = hand.problem;
  problem.num_frames = 1;
  problem.num_points = 2;
  problem.views = {ViewAt({3, 4, 5}, 0), ViewAt({3 - baseline, 4, 5}, 0)};
  problem.fixed_points = {origin, origin + Vector3d(1, 0, 0)};
  problem.observations = {AtSlope(-kSlope, 0, 0), AtSlope(kSlope, 1, 1)};
  IndexObservations(&problem);
  hand.certificate = Pressed({Pull::Kind::kView, 1, {0, 0, -1}});
  // Seen from the camera the points press where the rays pressed.
  for (CertifiedObservation& o : hand.certificate.observations) o.y *= -1;
  hand.truth = -origin.z() + (1 - baseline) * kTrueDepth;
  return hand;
}

std::vector<ByHand> All(const Vector3d& origin) {
  return {FarthestPoint(origin), FarthestCamera(origin, 0),
          FarthestCamera(origin, 0.25)};
}

ExtentCheck Check(const ByHand& hand) {
  return CheckExtent(hand.problem, Norm::L2(), hand.certificate);
}

TEST(CheckExtent, AcceptsWhatIsProvedByHand) {
  for (const ByHand& hand : All({7, -11, 13})) {
    const ExtentCheck check = Check(hand);
    ASSERT_TRUE(check.is_accepted) << check.refusal;
    EXPECT_GE(check.extent, hand.truth);
    EXPECT_LE(check.extent, hand.truth + 10 * kEta);
  }
}

TEST(CheckExtent, CoversItsRoundingFarFromTheOrigin) {
  for (const Vector3d& origin :
       {Vector3d(1e9, -1e9, 0), Vector3d(1e8 / 3, 1e8 / 7, 0)}) {
    for (const ByHand& hand : All(origin)) {
      const ExtentCheck check = Check(hand);
      if (check.is_accepted) {
        EXPECT_GE(check.extent, hand.truth);
      }
    }
  }
}

// What is accepted of a certificate that was tampered with is still true.
TEST(CheckExtent, RefusesWhatIsTamperedWithOrProvesLess) {
  const double t = 1e-6;
  const std::vector<std::function<void(ExtentCertificate*)>> changes = {
      [&](auto* c) { c->pulls[0].direction *= 1 + t; },
      [&](auto* c) { c->pulls[0].direction *= -1; },
      [&](auto* c) { c->pulls[0].direction.x() += t; },
      [&](auto* c) { c->bound *= 1 - t; },
      [&](auto* c) { c->bound *= 1 + t; },
      [&](auto* c) { c->observations[0].lambda *= 1 + t; },
      [&](auto* c) { c->observations[1].y *= -1; },
      [&](auto* c) {
        c->observations[1].y[1] += t * c->observations[0].lambda;
      },
      [&](auto* c) { c->observations[0].y *= 1 + t; },
      [&](auto* c) { c->observations.pop_back(); },
      [&](auto* c) { c->pulls.clear(); },
  };
  for (const ByHand& hand : All({7, -11, 13})) {
    for (size_t n = 0; n < changes.size(); ++n) {
      ByHand changed = hand;
      changes[n](&changed.certificate);
      EXPECT_FALSE(Check(changed).is_accepted) << n;
    }
  }
}

TEST(BalancingPull, IsWhatIsMissingAtTheFrameInUnitsOfTheDirection) {
  for (const double baseline : {0.0, 0.25}) {
    ByHand hand = FarthestCamera({7, -11, 13}, baseline);
    EXPECT_NEAR(BalancingPull(hand.problem, hand.certificate, 0, {0, 0, -4}), 0,
                10 * kEta);
    hand.certificate.pulls.clear();
    EXPECT_NEAR(BalancingPull(hand.problem, hand.certificate, 0, {0, 0, -4}),
                0.25, 10 * kEta);
    hand.certificate.pulls = {{Pull::Kind::kView, 1, {0, 0, 1}}};
    EXPECT_NEAR(BalancingPull(hand.problem, hand.certificate, 0, {0, 0, -4}),
                0.5, 10 * kEta);
  }
}

TEST(CheckExtent, SaysWhatIsWrong) {
  const auto refusal = [](const std::function<void(ByHand*)>& change) {
    ByHand hand = FarthestCamera({7, -11, 13}, 0.25);
    change(&hand);
    const ExtentCheck check = Check(hand);
    EXPECT_FALSE(check.is_accepted);
    return check.refusal;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto pull = [](ByHand* hand) -> Pull& {
    return hand->certificate.pulls[0];
  };
  EXPECT_THAT(refusal([&](ByHand* h) { pull(h).direction.y() = nan; }),
              HasSubstr("no finite number"));
  for (const int32_t index : {-1, 2}) {
    EXPECT_THAT(refusal([&](ByHand* h) { pull(h).index = index; }),
                HasSubstr("what is not there"));
  }
  EXPECT_THAT(refusal([&](ByHand* h) {
                h->problem.views.push_back(ViewAt({0, 0, 0}, 0));
                pull(h).index = 2;
              }),
              HasSubstr("does not hold what is pulled"));
  EXPECT_THAT(refusal([](ByHand* h) { h->problem.fixed_points.clear(); }),
              HasSubstr("nothing fixed"));
  EXPECT_THAT(refusal([](ByHand* h) { h->certificate.bound = -kBound; }),
              HasSubstr("lower bound"));
  EXPECT_THAT(refusal([](ByHand* h) {
                h->certificate.observations[0].y /= 1 - 2 * kEta;
              }),
              HasSubstr("longer than lambda"));
}

}  // namespace
}  // namespace krot
