#include "krot/convert/build_problem.h"

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

using Eigen::Vector3d;

Ray RayThrough(const Vector3d& centre, const Vector3d& point) {
  return {centre, (point - centre).normalized()};
}

TEST(RetriangulateMidpoint, FindsThePointThatRaysMeetIn) {
  const Vector3d point(1, 2, 8);
  const auto found = RetriangulateMidpoint({RayThrough({0, 0, 0}, point),
                                            RayThrough({1, 0, 0}, point),
                                            RayThrough({0, 1, 1}, point)});
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR((*found - point).norm(), 0, 1e-13);
}

TEST(RetriangulateMidpoint, OfTwoSkewRaysIsMidwayBetweenThem) {
  // Along x at z = 1 and along y at z = 3.
  const auto found =
      RetriangulateMidpoint({{{-5, 7, 1}, {1, 0, 0}}, {{4, 9, 3}, {0, 1, 0}}});
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR((*found - Vector3d(4, 7, 2)).norm(), 0, 1e-13);
}

TEST(RetriangulateMidpoint, LosesNoDigitsFarFromTheOrigin) {
  const Vector3d offset(5e6, -4e6, 3e6);
  const Vector3d point = Vector3d(1, 2, 8) + offset;
  const auto found =
      RetriangulateMidpoint({RayThrough(Vector3d(0, 0, 0) + offset, point),
                             RayThrough(Vector3d(1, 0, 0) + offset, point)});
  ASSERT_TRUE(found.has_value());
  // The spacing of doubles at 5e6 is 9e-10.
  EXPECT_NEAR((*found - point).norm(), 0, 2e-9);
}

TEST(RetriangulateMidpoint, OfParallelRaysIsNone) {
  const Vector3d direction = Vector3d(0.3, -0.2, 1).normalized();
  EXPECT_FALSE(
      RetriangulateMidpoint({{{0, 0, 0}, direction}, {{1, 0, 0}, direction}})
          .has_value());
}

TEST(RetriangulateMidpoint, OfOneImageTwiceIsNone) {
  const Ray ray = RayThrough({1, 2, 3}, {4, 4, 9});
  EXPECT_FALSE(RetriangulateMidpoint({ray, ray}).has_value());
}

TEST(RetriangulateMidpoint, OfNoRaysIsNone) {
  EXPECT_FALSE(RetriangulateMidpoint({}).has_value());
}

}  // namespace
}  // namespace krot::internal
