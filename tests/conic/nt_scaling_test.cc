#include "krot/conic/nt_scaling.h"

#include <gtest/gtest.h>

#include "tests/conic/random_cones.h"

namespace krot {
namespace {

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

using Cones = testing::Types<SecondOrderCone, FourHalfLines>;
TYPED_TEST_SUITE(NtScalingTest, Cones);

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
}  // namespace krot
