#include "krot/verify/certificate_check.h"

#include <cmath>
#include <functional>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/verify/force_checker.h"

namespace krot::internal {
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
// They press the other way where no depth is to be below so much.
constexpr double kLeastDepth = 0.5 / (kSlope + kBound / kFocal);

struct ByHand {
  KnownRotationProblem problem;
  ExtentCertificate certificate;
  long double truth = 0;
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
// right at the second; or, of a negative sign, the other way.
ExtentCertificate Pressed(const Pull& pull, double sign = 1,
                          double eta = kEta) {
  const double y = 1 - eta;
  const double lambda = 0.5 / (kSlope * kFocal * y - sign * kBound);
  return {kBound,
          {pull},
          {{0, lambda, {sign * y * lambda, 0}},
           {1, lambda, {-sign * y * lambda, 0}}}};
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

// The same of two cameras of one frame, of translation -`origin`; or, of a
// negative sign, how near.
ByHand PointBeforeRig(const Vector3d& origin, double sign) {
  ByHand hand;
  KnownRotationProblem& problem = hand.problem;
  problem.num_frames = problem.num_points = 1;
  problem.views = {ViewAt(Vector3d::Zero(), 0), ViewAt({-1, 0, 0}, 0)};
  problem.fixed_translations = {Vector3d(-origin)};
  problem.observations = {AtSlope(kSlope, 0, 0), AtSlope(-kSlope, 1, 0)};
  IndexObservations(&problem);
  hand.certificate = Pressed({Pull::Kind::kPoint, 0, {0, 0, sign}}, sign);
  hand.truth = sign * (static_cast<long double>(origin.z()) +
                       (sign > 0 ? kTrueDepth : kLeastDepth));
  return hand;
}

// How far back the camera can be from two points, the first at `origin`; a
// second camera in its frame, `baseline` beside it and `ahead`, may see the
// other, and be meant.
ByHand FarthestCamera(const Vector3d& origin, double baseline,
                      double ahead = 0) {
  ByHand hand;
  KnownRotationProblem& problem = hand.problem;
  problem.num_frames = 1;
  problem.num_points = 2;
  problem.views = {ViewAt({3, 4, 5}, 0),
                   ViewAt({3 - baseline, 4, 5 - ahead}, 0)};
  problem.fixed_points = {origin, origin + Vector3d(1, 0, 0)};
  problem.observations = {AtSlope(-kSlope, 0, 0), AtSlope(kSlope, 1, 1)};
  IndexObservations(&problem);
  hand.certificate = Pressed({Pull::Kind::kView, 1, {0, 0, -1}});
  // Seen from the camera the points press where the rays pressed.
  for (CertifiedObservation& o : hand.certificate.observations) o.y *= -1;
  hand.truth = -static_cast<long double>(origin.z()) +
               (1 - baseline) * kTrueDepth - ahead / 2;
  return hand;
}

std::vector<ByHand> All(const Vector3d& origin) {
  return {FarthestPoint(origin),        FarthestCamera(origin, 0),
          FarthestCamera(origin, 0.25), FarthestCamera(origin, 0.25, 0.5),
          PointBeforeRig(origin, 1),    PointBeforeRig(origin, -1)};
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

// What stands at the points' own coordinates is known exactly, so that nothing
// but the last roundings can be what brings an extent below the truth.
TEST(CheckExtent, RoundsUp) {
  for (const double z : {1e9, 1e9 / 3, 1e9 / 7, 1e9 / 11, 1e9 / 13}) {
    for (const double sign : {-1.0, 1.0}) {
      const ByHand hand = FarthestCamera({0, 0, sign * z}, 0);
      const ExtentCheck check = Check(hand);
      ASSERT_TRUE(check.is_accepted) << check.refusal;
      EXPECT_GE(check.extent, hand.truth);
      EXPECT_LE(check.extent, hand.truth + 1e-6);
    }
  }
}

// From far away, rotations as near as they are known to be make a difference.
TEST(CheckExtent, CoversWhereAFixedFrameMayBe) {
  for (const double sign : {-1.0, 1.0}) {
    const ByHand hand = PointBeforeRig({0, 1e8, 0}, sign);
    const ExtentCheck check = Check(hand);
    ASSERT_TRUE(check.is_accepted) << check.refusal;
    // O = -R't moves by this much along z if R is turned about x.
    const double difference = kRotationError * 1e8;
    EXPECT_GE(check.extent, hand.truth + difference);
    EXPECT_LE(check.extent, hand.truth + 100 * difference);
  }
}

// The rho of a certificate that presses with y = (1 - eta) lambda.
std::optional<double> RhoOf(double eta, ByHand* hand) {
  *hand = FarthestCamera({7, -11, 13}, 0);
  ExtentCertificate& certificate = hand->certificate;
  certificate = Pressed(certificate.pulls[0], 1, eta);
  for (CertifiedObservation& o : certificate.observations) o.y *= -1;
  const Certificate rows{certificate.bound, 0, certificate.observations};
  ForceChecker checker(hand->problem, Norm::L2(), rows, certificate.pulls);
  if (checker.Balance()) return std::nullopt;
  std::string refusal;
  return checker.BoundRho(&refusal);
}

TEST(CheckExtent, AcceptsARhoOfOneAtMost) {
  ByHand hand;
  const std::optional<double> of_zero = RhoOf(0, &hand);
  ASSERT_TRUE(of_zero);
  bool is_one = false;
  for (int n = -1000; n < 1000; ++n) {
    const std::optional<double> rho =
        RhoOf(*of_zero - 1 + std::ldexp(n, -53), &hand);
    ASSERT_TRUE(rho);
    ASSERT_EQ(Check(hand).is_accepted, *rho <= 1) << *rho - 1;
    is_one = is_one || *rho == 1;
  }
  EXPECT_TRUE(is_one);
}

TEST(CheckExtent, TakesAPullInPieces) {
  for (ByHand& hand : All({7, -11, 13})) {
    Pull piece = hand.certificate.pulls[0];
    piece.direction /= 8;
    hand.certificate.pulls.assign(8, piece);
    const ExtentCheck check = Check(hand);
    ASSERT_TRUE(check.is_accepted) << check.refusal;
    EXPECT_GE(check.extent, hand.truth);
    EXPECT_LE(check.extent, hand.truth + 10 * kEta);
  }
}

// A pull and its opposite have a sum that is nothing, and beside which all
// other forces may have been lost.
TEST(CheckExtent, RefusesPullsThatCancelAllOthers) {
  for (const double much : {0x1p60, 0x1p70, 0x1p300}) {
    for (ByHand& hand : All({7, -11, 13})) {
      std::vector<Pull>& pulls = hand.certificate.pulls;
      pulls[0].direction *= -1;
      pulls.push_back({pulls[0].kind, pulls[0].index, {0, 0, much}});
      pulls.push_back({pulls[0].kind, pulls[0].index, {0, 0, -much}});
      EXPECT_FALSE(Check(hand).is_accepted);
    }
  }
}

// There any force is taken: it need not balance, and proves nothing.
TEST(CheckExtent, RefusesPullsAtWhatIsFixed) {
  ByHand point = FarthestPoint({7, -11, 13});
  point.certificate.pulls.push_back({Pull::Kind::kView, 1, {1, 0, 0}});
  EXPECT_THAT(Check(point).refusal, HasSubstr("what is fixed"));
  ByHand camera = FarthestCamera({7, -11, 13}, 0);
  camera.certificate.pulls.push_back({Pull::Kind::kPoint, 1, {1, 0, 0}});
  EXPECT_THAT(Check(camera).refusal, HasSubstr("what is fixed"));
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
    const Pull keeper{Pull::Kind::kView, 0, {0, 0, -4}};
    EXPECT_NEAR(BalancingPull(hand.problem, hand.certificate, keeper), 0,
                10 * kEta);
    hand.certificate.pulls.clear();
    EXPECT_NEAR(BalancingPull(hand.problem, hand.certificate, keeper), 0.25,
                10 * kEta);
    hand.certificate.pulls = {{Pull::Kind::kView, 1, {0, 0, 1}}};
    EXPECT_NEAR(BalancingPull(hand.problem, hand.certificate, keeper), 0.5,
                10 * kEta);
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
}  // namespace krot::internal
