#include "krot/verify/force_checker.h"

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/verify/certificate_check.h"

namespace krot::internal {
namespace {

using Real = ObservationForce::Real;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;
using Vector3 = ObservationForce::Vector3;

constexpr Real kUnit = std::numeric_limits<Real>::epsilon() / 2;

TEST(ObservationForce, IsTheSumOfTheRowsTimesTheMultipliers) {
  Observation observation;
  observation.E << 1, -2, 3, -4, 5, -6, 7, 8, -9;
  const ObservationForce force = MakeForce(observation, {-10, 100}, 1000);
  EXPECT_EQ(force.sum,
            Vector3(1000 + 40 + 700, -2000 - 50 + 800, 3000 + 60 - 900));
  EXPECT_EQ(force.terms,
            Vector3(1000 + 40 + 700, 2000 + 50 + 800, 3000 + 60 + 900));
}

TEST(RoundingError, CoversTwelveRoundingsOfEachTermAndOneOfEachSum) {
  for (const size_t count : {1, 2, 3, 10, 1000, 1000000}) {
    const Real all =
        std::expm1((12 + static_cast<Real>(count)) * std::log1p(kUnit));
    EXPECT_GE(RoundingError(count), all);
    EXPECT_LE(RoundingError(count), 2 * all);
  }
}

// Each of the terms is less than what the sum rounds to.
TEST(RoundingError, CoversASumThatLosesAllTermsButTheFirst) {
  const int count = 1000;
  const Real lost = 0.99L * kUnit;
  Real sum = 1;
  for (int n = 1; n < count; ++n) sum += lost;
  ASSERT_EQ(sum, 1);
  EXPECT_GE(RoundingError(count), (count - 1) * lost);
}

TEST(ForceError, CoversWhateverMatrixIsAsNear) {
  for (const size_t count : {1, 1000, 100000000}) {
    const Real entry = kRotationError + RoundingError(count);
    EXPECT_GE(ForceError(count), Vector3::Constant(entry).norm());
    EXPECT_LE(ForceError(count), 2 * entry);
  }
}

// Of rows whose lengths differ by ten decades, in any unit, by the inverse, and
// outwards by a billionth.
TEST(Compliance, IsWhatTheRowsOfTheInverseAreLong) {
  std::mt19937 generator(3);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 200; ++n) {
    Observation observation;
    for (double& entry : observation.E.reshaped()) entry = normal(generator);
    observation.E.row(n % 3) *= 1e10;
    observation.E *= std::pow(10, n % 7 - 10);
    const Matrix3 rows =
        Matrix3(observation.E.cast<Real>()).inverse().transpose();
    const std::optional<Compliance> compliance = MakeCompliance(observation);
    ASSERT_TRUE(compliance);
    const Real y = rows.bottomRows<2>().norm();
    const Real depth = rows.row(0).norm();
    EXPECT_GE(compliance->y, y);
    EXPECT_LE(compliance->y, y * (1 + 2e-9L));
    EXPECT_GE(compliance->delta_lambda, depth);
    EXPECT_LE(compliance->delta_lambda, depth * (1 + 2e-9L));
  }
}

Eigen::Vector3d RandomIntegers(int bits, std::mt19937_64* generator) {
  std::uniform_int_distribution<int64_t> integer(1, int64_t{1} << bits);
  return Eigen::Vector3d::NullaryExpr(
      [&] { return static_cast<double>(integer(*generator)); });
}

// Rows a and a + s have a x (a + s) = a x s, which does without the difference
// of numbers that nearly agree.
TEST(Compliance, CoversItsRoundingWhereRowsNearlyDepend) {
  std::mt19937_64 generator(4);
  for (int n = 0; n < 200; ++n) {
    const Eigen::Vector3d a = RandomIntegers(50, &generator);
    const Eigen::Vector3d s = RandomIntegers(5, &generator);
    const Eigen::Vector3d b = RandomIntegers(50, &generator);
    Observation observation;
    observation.E << b.transpose(), a.transpose(), (a + s).transpose();
    const std::optional<Compliance> compliance = MakeCompliance(observation);
    ASSERT_TRUE(compliance);
    const Vector3 across =
        Vector3(a.cast<Real>()).cross(Vector3(s.cast<Real>()));
    const Real det = std::abs(across.dot(b.cast<Real>()));
    const Vector3 of_a = Vector3(b.cast<Real>()).cross(Vector3(a.cast<Real>()));
    EXPECT_GE(compliance->delta_lambda, across.norm() / det);
    EXPECT_GE(compliance->y,
              (1 - 1e-12L) * std::sqrt(2.0L) * of_a.norm() / det);
    EXPECT_LE(compliance->y, (1 + 0.1L) * std::sqrt(2.0L) * of_a.norm() / det);
  }
}

TEST(Compliance, IsNoneWhereRowsDepend) {
  std::mt19937_64 generator(5);
  for (int n = 0; n < 200; ++n) {
    const Eigen::Vector3d a = RandomIntegers(50, &generator);
    const Eigen::Vector3d b = RandomIntegers(50, &generator);
    Observation observation;
    observation.E << a.transpose(), b.transpose(), (a + b).transpose();
    observation.E *= std::ldexp(1, 10 * (n % 13 - 10));
    EXPECT_FALSE(MakeCompliance(observation));
  }
}

TEST(Compliance, IsNoneOfWhatIsNoNumber) {
  for (const double entry : {0.0, double{INFINITY}, double{NAN}}) {
    for (int row = 0; row < 3; ++row) {
      Observation observation;
      observation.E.setIdentity();
      observation.E.row(row).setConstant(entry);
      EXPECT_FALSE(MakeCompliance(observation));
    }
  }
}

}  // namespace
}  // namespace krot::internal
