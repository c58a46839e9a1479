#include "krot/minimax.h"

#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "krot/math/simplex_qp.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

class MinEnclosingBallTest : public testing::Test {
 protected:
  Vector3d Normal3() {
    return {normal_(generator_), normal_(generator_), normal_(generator_)};
  }

  std::mt19937 generator_{1};
  std::normal_distribution<double> normal_;
};

double RadiusAround(const Vector3d& center,
                    const std::vector<Vector3d>& points) {
  double radius = 0;
  for (const Vector3d& p : points)
    radius = std::max(radius, (p - center).norm());
  return radius;
}

TEST_F(MinEnclosingBallTest, OfOnePointIsThePoint) {
  const Vector3d p(1, 2, 3);
  const Ball ball = MinEnclosingBall(&p, 1);
  EXPECT_EQ(ball.center, p);
  EXPECT_EQ(ball.radius, 0);
}

TEST_F(MinEnclosingBallTest, OfTwoPointsIsCentredAtTheirMidpoint) {
  const Vector3d points[] = {{1, 0, 0}, {3, 4, 0}};
  const Ball ball = MinEnclosingBall(points, 2);
  EXPECT_TRUE(ball.center.isApprox(Vector3d(2, 2, 0)));
  EXPECT_DOUBLE_EQ(ball.radius, std::sqrt(5.0));
}

TEST_F(MinEnclosingBallTest, OfAnObtuseTriangleHasItsLongestSideAsDiameter) {
  const Vector3d points[] = {{-2, 0, 0}, {2, 0, 0}, {0, 1, 0}};
  const Ball ball = MinEnclosingBall(points, 3);
  EXPECT_NEAR(ball.center.norm(), 0, 1e-15);
  EXPECT_DOUBLE_EQ(ball.radius, 2);
}

TEST_F(MinEnclosingBallTest, OfAnAcuteTriangleIsItsCircumcircle) {
  const double h = std::sqrt(3.0) / 2;
  const Vector3d points[] = {{1, 0, 5}, {-0.5, h, 5}, {-0.5, -h, 5}};
  const Ball ball = MinEnclosingBall(points, 3);
  EXPECT_TRUE(ball.center.isApprox(Vector3d(0, 0, 5)));
  EXPECT_NEAR(ball.radius, 1, 1e-15);
}

// Case 4.2: unit vectors that need all four are centred at the origin.
TEST_F(MinEnclosingBallTest, OfFourUnitVectorsAroundTheOriginIsTheUnitBall) {
  int found = 0;
  for (int trial = 0; trial < 5000; ++trial) {
    std::vector<Vector3d> points(4);
    for (Vector3d& p : points) p = Normal3().normalized();
    std::vector<LinearPiece> scratch;
    if (MinNormPoint(points.data(), 4, &scratch).norm() > 1e-12) continue;
    ++found;
    const Ball ball = MinEnclosingBall(points.data(), 4);
    EXPECT_NEAR(ball.center.norm(), 0, 1e-9);
    EXPECT_NEAR(ball.radius, 1, 1e-9);
  }
  EXPECT_GT(found, 300);
}

// max |g - m|^2 = 1 + |m|^2 - 2 min g.m for unit g.
TEST_F(MinEnclosingBallTest, OfUnitVectorsIsCentredAtTheirLeastNormPoint) {
  std::vector<LinearPiece> scratch;
  for (int trial = 0; trial < 5000; ++trial) {
    std::vector<Vector3d> points(1 + trial % 4);
    for (Vector3d& p : points) p = Normal3().normalized();
    const int count = static_cast<int>(points.size());
    const Ball ball = MinEnclosingBall(points.data(), count);
    EXPECT_LE(
        (ball.center - MinNormPoint(points.data(), count, &scratch)).norm(),
        1e-7);
  }
}

TEST_F(MinEnclosingBallTest, HoldsAllPointsAndNoNeighbourIsSmaller) {
  for (int trial = 0; trial < 3000; ++trial) {
    std::vector<Vector3d> points(2 + trial % 3);
    for (Vector3d& p : points) p = Normal3();
    if (trial % 7 == 0) points.back() = points.front();  // twice
    if (trial % 11 == 0) points.back() = 0.5 * (points[0] + points[1]);
    const Ball ball =
        MinEnclosingBall(points.data(), static_cast<int>(points.size()));
    EXPECT_NEAR(RadiusAround(ball.center, points), ball.radius, 1e-9);
    for (int other = 0; other < 20; ++other) {
      const Vector3d center = ball.center + 1e-3 * Normal3();
      EXPECT_GE(RadiusAround(center, points), ball.radius - 1e-12);
    }
  }
}

TEST_F(MinEnclosingBallTest, OfNearlyCoincidentPointsIsTiny) {
  const Vector3d p(1, 2, 3);
  const Vector3d points[] = {p, p, p + Vector3d(1e-17, 0, 0), p};
  const Ball ball = MinEnclosingBall(points, 4);
  EXPECT_LE((ball.center - p).norm(), 1e-15);
  EXPECT_LE(ball.radius, 1e-15);
}

TEST_F(MinEnclosingBallTest, RefusesOtherCounts) {
  const std::vector<Vector3d> points(5, Vector3d::Zero());
  EXPECT_THROW(MinEnclosingBall(points.data(), 0), std::invalid_argument);
  EXPECT_THROW(MinEnclosingBall(points.data(), 5), std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
