#include "krot/conic/cones.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <type_traits>

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

constexpr int kTrials = 2000;

// Random vectors of a cone's space.
template <typename Cone>
class ConeGenerator {
 public:
  using Vector = typename Cone::Vector;

  explicit ConeGenerator(unsigned seed) : generator_(seed) {}

  // Each entry uniform in [-1, 1].
  Vector Direction() {
    Vector d;
    for (double& entry : d) entry = uniform_(generator_);
    return d;
  }

  // Inside the cone; the smallest eigenvalue is `margin`, the others up to 2
  // larger, and all are multiplied by 10^decade.
  Vector Inside(double margin, double decade) {
    Vector x = Direction();
    x += (margin - Cone::SmallestEigenvalue(x)) * Cone::Identity();
    return std::pow(10, decade) * x;
  }

 private:
  std::mt19937 generator_;
  std::uniform_real_distribution<double> uniform_{-1, 1};
};

template <typename Cone>
class ConeTest : public testing::Test {
 protected:
  using Vector = typename Cone::Vector;

  // The step to the boundary by bisection on the smallest eigenvalue.
  static double Bisect(const Vector& x, const Vector& d, double limit) {
    if (Cone::SmallestEigenvalue(x + limit * d) >= 0) return limit;
    double inside = 0;
    double outside = limit;
    for (int n = 0; n < 100; ++n) {
      const double middle = (inside + outside) / 2;
      (Cone::SmallestEigenvalue(x + middle * d) >= 0 ? inside : outside) =
          middle;
    }
    return inside;
  }
};

using Cones = testing::Types<SecondOrderCone, FourHalfLines,
                             WithHalfLine<SecondOrderCone>>;
TYPED_TEST_SUITE(ConeTest, Cones);

TYPED_TEST(ConeTest, IdentityIsNeutralAndInside) {
  const auto e = TypeParam::Identity();
  EXPECT_EQ(TypeParam::SmallestEigenvalue(e), 1);
  EXPECT_EQ(e.squaredNorm(), TypeParam::kDegree);  // e.e = degree
  ConeGenerator<TypeParam> random(1);
  for (int n = 0; n < kTrials; ++n) {
    const auto x = random.Direction();
    EXPECT_EQ(TypeParam::Product(e, x), x);
    EXPECT_EQ(TypeParam::Product(x, e), x);
  }
}

TYPED_TEST(ConeTest, DivideInvertsTheProduct) {
  ConeGenerator<TypeParam> random(2);
  for (int n = 0; n < kTrials; ++n) {
    const double margin = std::pow(10, -(n % 7));
    const auto x = random.Inside(margin, 0);
    const auto y = random.Direction();
    const auto quotient = TypeParam::Divide(x, TypeParam::Product(x, y));
    // The product's condition is that of x.
    EXPECT_LT((quotient - y).norm(), 4e-15 / margin);
  }
}

template <int kDim>
void ExpectInsideWithTheMultiplier(Norm norm, const Eigen::Vector3d& m) {
  const auto z = FromMultiplier<kDim>(norm, m[0], m.tail<2>());
  EXPECT_LT((ConeMap<kDim>(norm).transpose() * z - m).norm(), 4e-15);
  using Cone = std::conditional_t<kDim == 3, SecondOrderCone, FourHalfLines>;
  EXPECT_GE(Cone::SmallestEigenvalue(z), -4e-15);
}

TEST(FromMultiplier, IsInTheConeAndHasTheMultiplier) {
  const double infinity = std::numeric_limits<double>::infinity();
  std::mt19937 generator(7);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (int n = 0; n < kTrials; ++n) {
    const Eigen::Vector2d y(uniform(generator), uniform(generator));
    // Every other one on the cone's boundary.
    const double more = n % 2 == 0 ? 0 : 1 + uniform(generator);
    ExpectInsideWithTheMultiplier<3>({2}, {y.norm() + more, y[0], y[1]});
    ExpectInsideWithTheMultiplier<4>(
        {1}, {y.lpNorm<Eigen::Infinity>() + more, y[0], y[1]});
    ExpectInsideWithTheMultiplier<4>({infinity},
                                     {y.lpNorm<1>() + more, y[0], y[1]});
  }
  ExpectInsideWithTheMultiplier<4>({1}, {0, 0, 0});
}

TYPED_TEST(ConeTest, SmallestEigenvalueIsWhatTheIdentityMayTakeAway) {
  ConeGenerator<TypeParam> random(3);
  for (int n = 0; n < kTrials; ++n) {
    const auto x = random.Direction();
    const double least = TypeParam::SmallestEigenvalue(x);
    EXPECT_NEAR(
        TypeParam::SmallestEigenvalue(x - least * TypeParam::Identity()), 0,
        1e-15);
    EXPECT_NEAR(TypeParam::SmallestEigenvalue(-2.0 * TypeParam::Identity()), -2,
                0);
  }
}

// Vectors with the same eigenvectors are those that commute as operators.
TYPED_TEST(ConeTest, ClampLimitsTheEigenvaluesAndNothingElse) {
  ConeGenerator<TypeParam> random(7);
  const auto e = TypeParam::Identity();
  const auto largest = [](const auto& x) {
    return -TypeParam::SmallestEigenvalue(-x);
  };
  const auto limit = [](double x, double low, double high) {
    return std::min(std::max(x, low), high);
  };
  for (int n = 0; n < kTrials; ++n) {
    const auto x = random.Direction();
    const double low = -0.1 * (n % 5);
    const double high = 0.2 + 0.1 * (n % 7);
    const auto clamped = TypeParam::Clamp(x, low, high);
    EXPECT_NEAR(TypeParam::SmallestEigenvalue(clamped),
                limit(TypeParam::SmallestEigenvalue(x), low, high), 1e-15);
    EXPECT_NEAR(largest(clamped), limit(largest(x), low, high), 1e-15);
    // x o (y o z) = y o (x o z)
    const auto z = random.Direction();
    EXPECT_LT((TypeParam::Product(x, TypeParam::Product(clamped, z)) -
               TypeParam::Product(clamped, TypeParam::Product(x, z)))
                  .norm(),
              1e-14);
    EXPECT_EQ(TypeParam::Clamp(x, -10, 10), x);
    EXPECT_LT((TypeParam::Clamp(0.5 * e, 1, 2) - e).norm(), 1e-15);
  }
}

TYPED_TEST(ConeTest, MaxStepEndsWhereBisectionFindsTheBoundary) {
  ConeGenerator<TypeParam> random(4);
  int num_limited = 0;
  for (int n = 0; n < kTrials; ++n) {
    const double margin = std::pow(10, -(n % 7));
    const auto x = random.Inside(margin, 0);
    const auto d = random.Direction();
    for (const double limit : {1 / 0.98, 1e3}) {
      const double expected = this->Bisect(x, d, limit);
      const double step = TypeParam::MaxStep(x, d, limit);
      EXPECT_NEAR(step, expected, 1e-9 * expected);
      if (expected < limit) {
        EXPECT_NEAR(TypeParam::SmallestEigenvalue(x + step * d), 0,
                    1e-14 * (x.norm() + step * d.norm()));
      }
      num_limited += expected == limit;
    }
  }
  EXPECT_GT(num_limited, kTrials / 50);  // both cases were seen
  EXPECT_LT(num_limited, kTrials);
}

TYPED_TEST(ConeTest, MaxStepTowardsTheApexEndsThere) {
  ConeGenerator<TypeParam> random(5);
  for (int n = 0; n < kTrials; ++n) {
    const auto x = random.Inside(0.1, 0);
    EXPECT_NEAR(TypeParam::MaxStep(x, -2 * x, 10), 0.5, 1e-6);
  }
  const auto e = TypeParam::Identity();
  EXPECT_EQ(TypeParam::MaxStep(e, -4 * e, 10), 0.25);
}

TYPED_TEST(ConeTest, MaxStepInsideTheConeIsTheLimit) {
  ConeGenerator<TypeParam> random(6);
  for (int n = 0; n < kTrials; ++n) {
    const auto x = random.Inside(0.1, 0);
    EXPECT_EQ(TypeParam::MaxStep(x, random.Inside(1e-3, 0), 7), 7);
    EXPECT_EQ(TypeParam::MaxStep(x, 0 * x, 7), 7);
  }
}

TEST(SecondOrderCone, DeterminantKeepsItsDigitsBesideTheBoundary) {
  const double norm = 5;  // of (3, 4)
  const double margin = std::ldexp(1.0, -40);
  EXPECT_EQ(SecondOrderCone::Determinant({norm + margin, 3, 4}),
            margin * (2 * norm + margin));
}

TEST(SecondOrderCone, MaxStepMeetsTheBoundaryAlongANullDirection) {
  // (2 - a, a, 0): on the boundary at a = 1; a null direction has no a^2.
  EXPECT_DOUBLE_EQ(SecondOrderCone::MaxStep({2, 0, 0}, {-1, 1, 0}, 9), 1);
  EXPECT_EQ(SecondOrderCone::MaxStep({2, 0, 0}, {1, 1, 0}, 9), 9);
}

using ScaledCones = testing::Types<SecondOrderCone, FourHalfLines>;

template <typename Cone>
class NtScalingTest : public testing::Test {
 protected:
  using Vector = typename Cone::Vector;

  // Pairs s, z whose smallest eigenvalues are `margin` of their size, and whose
  // sizes differ by up to 12 decades.
  template <typename Body>
  static void ForPairs(double margin, const Body& body) {
    ConeGenerator<Cone> random(1);
    for (int n = 0; n < 500; ++n) {
      const double decade = n % 7;
      body(random.Inside(margin, decade), random.Inside(margin, -decade));
    }
  }
};

TYPED_TEST_SUITE(NtScalingTest, ScaledCones);

TYPED_TEST(NtScalingTest, TakesZAndSToTheSamePoint) {
  for (const double margin : {1.0, 1e-2, 1e-4, 1e-6}) {
    this->ForPairs(margin, [&](const auto& s, const auto& z) {
      const NtScaling<TypeParam> W(s, z);
      const auto lambda = W.Apply(z);
      EXPECT_GT(TypeParam::SmallestEigenvalue(lambda), 0);
      EXPECT_LT((W.ApplyInverse(s) - lambda).norm(),
                1e-14 / margin * lambda.norm());
      EXPECT_NEAR(lambda.squaredNorm(), s.dot(z), 1e-14 / margin * s.dot(z));
    });
  }
}

TYPED_TEST(NtScalingTest, ApplyInverseUndoesApply) {
  ConeGenerator<TypeParam> random(2);
  for (const double margin : {1.0, 1e-2, 1e-4, 1e-6}) {
    this->ForPairs(margin, [&](const auto& s, const auto& z) {
      const NtScaling<TypeParam> W(s, z);
      const auto x = random.Direction();
      EXPECT_LT((W.ApplyInverse(W.Apply(x)) - x).norm(), 1e-14 / margin);
      EXPECT_LT((W.Apply(W.ApplyInverse(x)) - x).norm(), 1e-14 / margin);
    });
  }
}

TYPED_TEST(NtScalingTest, IsSymmetricAndPositiveDefinite) {
  ConeGenerator<TypeParam> random(3);
  this->ForPairs(1e-3, [&](const auto& s, const auto& z) {
    const NtScaling<TypeParam> W(s, z);
    const auto x = random.Direction();
    const auto y = random.Direction();
    const double size = W.Apply(x).norm() * y.norm() + W.Apply(y).norm();
    EXPECT_NEAR(x.dot(W.Apply(y)), y.dot(W.Apply(x)), 1e-14 * size);
    EXPECT_GT(x.dot(W.Apply(x)), 0);
  });
}

TYPED_TEST(NtScalingTest, TakesAPairWhereSmallestProductSays) {
  for (const double margin : {1.0, 1e-2, 1e-4, 1e-6}) {
    this->ForPairs(margin, [&](const auto& s, const auto& z) {
      const double root =
          TypeParam::SmallestEigenvalue(NtScaling<TypeParam>(s, z).Apply(z));
      EXPECT_NEAR(TypeParam::SmallestProduct(s, z), root * root,
                  1e-14 / margin * s.dot(z));
    });
  }
}

TYPED_TEST(NtScalingTest, OfACentredPairHasOneEigenvalue) {
  // s = mu z^-1: lambda is sqrt(mu) times the identity.
  ConeGenerator<TypeParam> random(4);
  for (int n = 0; n < 100; ++n) {
    const auto s = random.Inside(0.1, 0);
    const typename TypeParam::Vector z =
        9 * TypeParam::Divide(s, TypeParam::Identity());
    const auto lambda = NtScaling<TypeParam>(s, z).Apply(z);
    EXPECT_LT((lambda - 3 * TypeParam::Identity()).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace krot::internal
