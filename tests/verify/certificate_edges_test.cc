#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/verify/certificate_check.h"
#include "tests/verify/point_seen_twice.h"

// What is accepted just so, and what is refused as the next number.

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using ::testing::HasSubstr;

constexpr double kSeparation = 4.0 / 1024;

double Above(double x) {
  return std::nextafter(x, std::numeric_limits<double>::infinity());
}
double Below(double x) {
  return std::nextafter(x, -std::numeric_limits<double>::infinity());
}

// Of the certificate by hand, after a change; "" if it is accepted.
std::string Refusal(const std::function<void(Twice*)>& change,
                    Norm norm = Norm::L2()) {
  Twice twice = MakeTwice(kSeparation);
  change(&twice);
  const CertificateCheck check =
      CheckCertificate(twice.problem, norm, twice.certificate);
  EXPECT_EQ(check.is_accepted, check.refusal.empty());
  return check.refusal;
}

// Both y, and the bound that they prove.
void Lengthen(double factor, Certificate* certificate) {
  for (CertifiedObservation& o : certificate->observations) o.y *= factor;
  certificate->lower_bound *= factor;
}

TEST(CheckCertificate, LetsYBeLongerThanLambdaByATrillionth) {
  const double limit = 1 + 1e-12;
  EXPECT_EQ(
      Refusal([&](Twice* t) { Lengthen(limit, &t->certificate); }, Norm::L1()),
      "");
  EXPECT_THAT(
      Refusal([&](Twice* t) { Lengthen(Above(limit), &t->certificate); },
              Norm::L1()),
      HasSubstr("longer than lambda"));
}

TEST(CheckCertificate, AsksForADefectBetweenWhatItFindsAndAMillionth) {
  const Twice twice = MakeTwice(kSeparation);
  const double defect =
      CheckCertificate(twice.problem, Norm::L2(), twice.certificate).defect;
  ASSERT_GT(defect, 0);
  const auto refusal = [](double stated) {
    return Refusal([&](Twice* t) { t->certificate.defect = stated; });
  };
  EXPECT_EQ(refusal(defect), "");
  EXPECT_THAT(refusal(Below(defect)), HasSubstr("exceeds"));
  EXPECT_THAT(refusal(0), HasSubstr("exceeds"));
  EXPECT_THAT(refusal(Below(0)), HasSubstr("must be in [0, 1e-6]"));
  EXPECT_EQ(refusal(kMaxDefect), "");
  EXPECT_THAT(refusal(Above(kMaxDefect)), HasSubstr("must be in [0, 1e-6]"));
}

TEST(CheckCertificate, ProvesTheBoundOverRhoRoundedDown) {
  for (const double separation : {4.0 / 1024, 3.0 / 1024, 0.1 / 1024}) {
    const Twice twice = MakeTwice(separation);
    const CertificateCheck check =
        CheckCertificate(twice.problem, Norm::L2(), twice.certificate);
    ASSERT_TRUE(check.is_accepted) << check.refusal;
    const long double rho = 1 + static_cast<long double>(check.defect);
    const long double proved = twice.certificate.lower_bound / rho;
    EXPECT_LE(check.proved_bound, proved);
    EXPECT_GE(check.proved_bound, proved * (1 - 1e-15L));
  }
}

TEST(CheckCertificate, ProvesMoreThanItSaysWhereAllYAreShort) {
  Twice twice = MakeTwice(kSeparation);
  const double optimum = twice.certificate.lower_bound;
  Lengthen(0.5, &twice.certificate);
  twice.certificate.defect = 0;
  const CertificateCheck check =
      CheckCertificate(twice.problem, Norm::L2(), twice.certificate);
  EXPECT_TRUE(check.is_accepted) << check.refusal;
  EXPECT_EQ(check.defect, 0);
  EXPECT_LE(check.proved_bound, optimum);
  EXPECT_GE(check.proved_bound, optimum * (1 - 1e-11));
}

TEST(CheckCertificate, ProvesAsMuchInAnyUnitOfPixels) {
  for (const double unit : {1e-9, 1e-3, 1e9}) {
    Twice twice = MakeTwice(kSeparation);
    for (Observation& observation : twice.problem.observations) {
      observation.E.bottomRows<2>() *= unit;
    }
    twice.certificate.lower_bound *= unit;
    const CertificateCheck check =
        CheckCertificate(twice.problem, Norm::L2(), twice.certificate);
    EXPECT_TRUE(check.is_accepted) << check.refusal;
    EXPECT_GE(check.proved_bound, twice.certificate.lower_bound * (1 - 1e-11));
  }
}

// Of a point and a frame that are fixed there is one estimate.
TEST(CheckCertificate, ProvesTheErrorOfWhatIsFixedAndNoMore) {
  Twice twice = MakeTwice(kSeparation);
  KnownRotationProblem& problem = twice.problem;
  problem.fixed_translations = {Vector3d(-7, 11, -13)};
  problem.fixed_points = {Vector3d(10, -10, 18)};
  const Vector3d row = problem.observations[0].E * Vector3d(3, 1, 5);
  const Eigen::Vector2d v = row.tail<2>();
  const double error = v.norm() / row[0];
  for (const double share : {1 - 1e-9, 1 + 1e-9}) {
    twice.certificate = {error * share, 1e-9, {{0, 1, -v.normalized()}}};
    const CertificateCheck check =
        CheckCertificate(problem, Norm::L2(), twice.certificate);
    EXPECT_EQ(check.is_accepted, share < 1) << check.refusal;
  }
}

TEST(CheckCertificate, TakesNoObservationBeforeTheFirst) {
  EXPECT_THAT(Refusal([](Twice* t) {
                t->certificate.observations[0].observation = -1;
              }),
              HasSubstr("ascend"));
}

TEST(CheckCertificate, TakesLambdaDownToAHundredDecades) {
  const auto refusal = [](double lambda) {
    return Refusal([&](Twice* t) {
      t->certificate.observations[0].lambda = 2;
      t->certificate.observations[1].lambda = lambda;
      t->certificate.observations[1].y.setZero();
    });
  };
  EXPECT_THAT(refusal(0), HasSubstr("lambda is not positive"));
  EXPECT_THAT(refusal(Below(2e-100)), HasSubstr("100 decades"));
  // For another reason.
  EXPECT_THAT(refusal(2e-100), HasSubstr("do not balance"));
}

TEST(CheckCertificate, RefusesRaysThatAreNoNumbersOrNoRays) {
  for (const double entry : {0.0, std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity()}) {
    for (int row = 0; row < 3; ++row) {
      EXPECT_THAT(Refusal([&](Twice* t) {
                    t->problem.observations[1].E.row(row).setConstant(entry);
                  }),
                  HasSubstr("no finite number"));
    }
  }
}

Twice WithRotation(const Matrix3d& R) {
  Twice twice = MakeTwice(kSeparation);
  twice.problem.views[0].cam_from_rig_rotation = R;
  twice.problem.views[0].cam_from_world_rotation = R;
  return twice;
}

TEST(CheckCertificate, TakesRotationsToATrillionth) {
  const auto refusal = [](const Matrix3d& R) {
    return Refusal([&](Twice* t) { *t = WithRotation(R); });
  };
  Matrix3d R = Matrix3d::Identity();
  R(0, 1) = 1e-12;  // in R'R as well
  EXPECT_EQ(refusal(R), "");
  R(0, 1) = Above(1e-12);
  EXPECT_THAT(refusal(R), HasSubstr("a rotation of its views is none"));
  for (const double scale : {0.0, 0.5, 2.0}) {
    EXPECT_THAT(refusal(scale * Matrix3d::Identity()),
                HasSubstr("a rotation of its views is none"));
  }
}

// The point is seen by two views of one frame, the second of which is
// `baseline` away from the first, along x.
Twice OfARig(double baseline) {
  Twice twice = MakeTwice(kSeparation);
  View second = twice.problem.views[0];
  second.cam_from_rig_translation = {baseline, 0, 0};
  twice.problem.views.push_back(second);
  twice.problem.observations[1].view = 1;
  IndexObservations(&twice.problem);
  return twice;
}

TEST(CheckCertificate, TakesRotationsOfOneFrameThatAgreeToRounding) {
  const auto refusal = [](double entry) {
    return Refusal([&](Twice* t) {
      *t = OfARig(0);
      t->problem.views[1].cam_from_world_rotation(0, 1) = entry;
    });
  };
  for (const double sign : {-1.0, 1.0}) {
    EXPECT_EQ(refusal(sign * kRotationError), "");
    EXPECT_THAT(refusal(sign * Above(kRotationError)), HasSubstr("contradict"));
  }
}

// Rays that diverge to where the sensors stand apart meet: the cost is 0. Those
// of sensors on the other side do not.
TEST(CheckCertificate, RefusesConstantsAboveZeroHoweverSmallTheMultipliers) {
  for (const double scale : {0x1p-300, 1.0, 0x1p300}) {
    const auto refusal = [&](const Twice& twice) {
      return Refusal([&](Twice* t) {
        *t = twice;
        for (CertifiedObservation& o : t->certificate.observations) {
          o.lambda *= scale;
          o.y *= scale;
        }
      });
    };
    EXPECT_EQ(refusal(OfARig(0)), "");
    EXPECT_EQ(refusal(OfARig(-1e-3)), "");
    EXPECT_THAT(refusal(OfARig(1e-3)), HasSubstr("keep their sign"));
    // Where the sensors stand is known no better than so.
    Twice far_away = OfARig(0);
    for (View& view : far_away.problem.views) {
      view.cam_from_rig_translation = Vector3d(1e6, 0, 0);
    }
    EXPECT_THAT(refusal(far_away), HasSubstr("keep their sign"));
  }
}

}  // namespace
}  // namespace krot::internal
