#include "tools/benchmark/subproblem.h"

#include <gtest/gtest.h>
#include <Eigen/Dense>

namespace krot {
namespace {

TEST(MidPoint, OfRaysThatMeetIsWhereTheyMeet) {
  Random random(/*seed=*/1);
  const std::vector<Residual> rays =
      RandomTriangulation(2, /*sigma=*/0, &random);
  const auto middle = MidPoint(rays[0], rays[1]);
  ASSERT_TRUE(middle);
  for (const Residual& ray : rays) {
    EXPECT_NEAR(ResidualValue(ray, *middle, Norm::L2()), 0, 1e-9);
  }
}

TEST(MidPoint, IsAsFarFromBothRays) {
  Random random(/*seed=*/2);
  const std::vector<Residual> rays =
      RandomTriangulation(2, /*sigma=*/5, &random);
  const auto middle = MidPoint(rays[0], rays[1]);
  ASSERT_TRUE(middle);
  double distance[2];
  for (int i = 0; i < 2; ++i) {
    // The nearest point with v = 0, by the pseudo-inverse.
    const Eigen::Matrix<double, 2, 3>& A = rays[i].A;
    distance[i] = (A.transpose() * (A * A.transpose()).inverse() *
                   rays[i].Numerator(*middle))
                      .norm();
  }
  EXPECT_GT(distance[0], 0);
  EXPECT_NEAR(distance[0], distance[1], 1e-9);
}

TEST(MidPoint, DoesNotExistForOneRayTwice) {
  Random random(/*seed=*/3);
  const std::vector<Residual> rays = RandomTriangulation(1, 5, &random);
  EXPECT_FALSE(MidPoint(rays[0], rays[0]));
}

TEST(MakeTriangulation, StartsInFrontOfAllCamerasAtAMeanDepthOfOne) {
  Random random(/*seed=*/4);
  const auto problem =
      MakeTriangulation(RandomTriangulation(7, 5, &random), &random);
  ASSERT_TRUE(problem);
  double sum = 0;
  for (const Residual& residual : problem->residuals) {
    EXPECT_GT(residual.Depth(problem->start), 0);
    sum += residual.Depth(problem->start);
  }
  EXPECT_NEAR(sum / 7, 1, 1e-12);
}

TEST(MakeTriangulation, NeedsTwoRays) {
  Random random(/*seed=*/5);
  EXPECT_FALSE(MakeTriangulation(RandomTriangulation(1, 5, &random), &random));
}

}  // namespace
}  // namespace krot
