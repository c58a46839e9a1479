#include "tools/benchmark/rivals/proximal_operator.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "krot/synthetic/scene.h"

namespace krot::internal {
namespace {

using Vectors = std::vector<Eigen::Vector2d>;

double Objective(const Vectors& z, const Vectors& a, double rho) {
  double largest = 0;
  double squares = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    largest = std::max(largest, z[i].norm());
    squares += (z[i] - a[i]).squaredNorm();
  }
  return largest + rho / 2 * squares;
}

Vectors RandomVectors(int count, Random* random) {
  Vectors vectors;
  for (int i = 0; i < count; ++i) {
    vectors.emplace_back(random->Gaussian(), random->Gaussian());
  }
  return vectors;
}

TEST(MaxNormProx, IsALowerPointThanAnyNearby) {
  Random random(/*seed=*/1);
  for (const double rho : {0.1, 1.0, 10.0}) {
    const Vectors a = RandomVectors(6, &random);
    Vectors z = a;
    ApplyMaxNormProx(rho, &z);
    const double lowest = Objective(z, a, rho);
    for (int trial = 0; trial < 200; ++trial) {
      Vectors other = RandomVectors(6, &random);
      for (size_t i = 0; i < other.size(); ++i) {
        other[i] = z[i] + 1e-3 * other[i];
      }
      EXPECT_GE(Objective(other, a, rho), lowest);
    }
  }
}

TEST(MaxNormProx, ShortensByTheReciprocalOfThePenaltyInAll) {
  Vectors z = {{3, 4}, {0, 6}, {1, 0}};  // lengths 5, 6, 1
  ApplyMaxNormProx(/*rho=*/1 / 3.0, &z);
  // 5 and 6 become 4: 1 + 2 = 3.
  EXPECT_NEAR(z[0].norm(), 4, 1e-9);
  EXPECT_NEAR(z[1].norm(), 4, 1e-9);
  EXPECT_NEAR((z[0] - Eigen::Vector2d(2.4, 3.2)).norm(), 0, 1e-9);
  EXPECT_EQ(z[2], Eigen::Vector2d(1, 0));
}

TEST(MaxNormProx, IsZeroWhereThePenaltyIsSmall) {
  Vectors z = {{3, 4}, {0, 6}};
  ApplyMaxNormProx(/*rho=*/1 / 12.0, &z);
  for (const Eigen::Vector2d& vector : z) EXPECT_EQ(vector.norm(), 0);
}

}  // namespace
}  // namespace krot::internal
