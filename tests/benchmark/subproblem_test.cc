#include "tools/benchmark/subproblem.h"

#include <algorithm>

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "krot/problem/cost.h"
#include "tools/benchmark/synthetic_model.h"

namespace krot::internal {
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

TEST(MakeBlock, StartsWhereItStands) {
  Random random(/*seed=*/6);
  const std::vector<Residual> rays = RandomTriangulation(5, 5, &random);
  const auto middle = MidPoint(rays[0], rays[1]);
  ASSERT_TRUE(middle);
  const auto block = MakeBlock(rays, *middle);
  ASSERT_TRUE(block);
  for (int i = 0; i < 5; ++i) {
    const double r = ResidualValue(rays[i], *middle, Norm::L2());
    EXPECT_NEAR(ResidualValue(block->residuals[i], block->start, Norm::L2()), r,
                1e-9 * r);
  }
}

TEST(MakeBlock, NeedsRaysThatMeet) {
  Random random(/*seed=*/7);
  const std::vector<Residual> rays = RandomTriangulation(2, 5, &random);
  const auto middle = MidPoint(rays[0], rays[1]);
  ASSERT_TRUE(middle);
  EXPECT_FALSE(MakeBlock({rays[0], rays[0]}, *middle));
}

// Moving a frame or a point changes the same residuals of the problem.
TEST(Residuals, OfPointsAndFramesAreThoseOfTheProblem) {
  const BenchmarkModel model =
      SyntheticModel({"small", 6, 60, 240}, /*seed=*/1);
  const KnownRotationProblem& problem = model.built.problem;
  Estimate moved = model.built.start;
  moved.translations[2][0] += 0.01;
  moved.points[7][1] += 0.01;
  const double pixels = Cost(problem, moved, Norm::L2(), 1);
  double largest = 0;
  int count = 0;
  const auto add = [&](const std::vector<Residual>& residuals,
                       const Eigen::Vector3d& x) {
    for (const Residual& residual : residuals) {
      largest = std::max(largest, ResidualValue(residual, x, Norm::L2()));
      ++count;
    }
  };
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    add(ResectionResiduals(problem, moved, f), moved.translations[f]);
  }
  EXPECT_NEAR(largest, pixels, 1e-9 * pixels);
  largest = 0;
  for (int32_t k = 0; k < problem.num_points; ++k) {
    add(IntersectionResiduals(problem, moved, k), moved.points[k]);
  }
  EXPECT_NEAR(largest, pixels, 1e-9 * pixels);
  EXPECT_EQ(count, 2 * static_cast<int>(problem.observations.size()));
}

}  // namespace
}  // namespace krot::internal
