#include "krot/problem/cost.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <stdexcept>
#include <vector>

#include "tests/problem/random_problem.h"

namespace krot::internal {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A pinhole camera's reprojection error, from scratch.
Eigen::Vector2d PinholeError(const View& view, const Eigen::Vector2d& pixel,
                             const Eigen::Vector3d& point,
                             const Eigen::Vector3d& translation, double fx,
                             double fy, double cx, double cy) {
  const Eigen::Vector3d x_cam = view.cam_from_world_rotation * point +
                                view.cam_from_rig_rotation * translation +
                                view.cam_from_rig_translation;
  return {fx * x_cam.x() / x_cam.z() + cx - pixel.x(),
          fy * x_cam.y() / x_cam.z() + cy - pixel.y()};
}

TEST(ResidualOf, IsThePixelErrorOfAPinholeCameraExactly) {
  const double fx = 1200, fy = 1150, cx = 640, cy = 480;
  RandomScene scene = MakeRandomScene({/*num_frames=*/4, /*num_points=*/30,
                                       /*views_per_frame=*/2,
                                       /*baseline=*/0.3, /*seed=*/2});
  for (Observation& observation : scene.problem.observations) {
    const Eigen::Vector2d u = RayOf(observation);
    observation.E = RowAtRay(u, Eigen::Vector2d(fx, fy).asDiagonal());
    const Eigen::Vector2d pixel(fx * u.x() + cx, fy * u.y() + cy);
    const ViewedPoint viewed =
        ViewPoint(scene.problem, observation, scene.estimate);
    const View& view = scene.problem.views[observation.view];
    const Eigen::Vector2d error =
        PinholeError(view, pixel, scene.estimate.points[observation.point],
                     scene.estimate.translations[view.frame], fx, fy, cx, cy);
    // Rounding of pixels near 1000, 1.1e-13 each.
    EXPECT_NEAR(viewed.v.x() / viewed.depth, error.x(), 1e-12);
    EXPECT_NEAR(viewed.v.y() / viewed.depth, error.y(), 1e-12);
    EXPECT_NEAR(ResidualOf(viewed, Norm::L2()), error.norm(), 1e-12);
  }
}

TEST(ResidualOf, TakesAnyNorm) {
  const ViewedPoint viewed{2, {-6, 8}};
  EXPECT_DOUBLE_EQ(ResidualOf(viewed, Norm::L1()), 7);
  EXPECT_DOUBLE_EQ(ResidualOf(viewed, Norm::L2()), 5);
  EXPECT_DOUBLE_EQ(ResidualOf(viewed, Norm::LInf()), 4);
  EXPECT_DOUBLE_EQ(ResidualOf(viewed, Norm{3}), std::cbrt(27.0 + 64.0));
  EXPECT_DOUBLE_EQ(ResidualOf(viewed, Norm{1.5}),
                   std::pow(std::pow(3, 1.5) + std::pow(4, 1.5), 1 / 1.5));
}

TEST(ResidualOf, OfALargePowerNeitherOverflowsNorVanishes) {
  EXPECT_NEAR(ResidualOf({1, {3e5, 4e5}}, Norm{100}), 4e5, 1e-6);
  EXPECT_NEAR(ResidualOf({1, {3e-5, 4e-5}}, Norm{100}), 4e-5, 1e-16);
  EXPECT_EQ(ResidualOf({1, {0, 0}}, Norm{100}), 0);
}

TEST(ResidualOf, IsInfiniteUnlessTheDepthIsPositive) {
  EXPECT_EQ(ResidualOf({0, {1, 0}}, Norm::L2()), kInfinity);
  EXPECT_EQ(ResidualOf({-1, {1, 0}}, Norm::L2()), kInfinity);
  EXPECT_EQ(ResidualOf({std::nan(""), {1, 0}}, Norm::L2()), kInfinity);
  EXPECT_EQ(ResidualOf({1, {std::nan(""), 0}}, Norm::L2()), kInfinity);
}

TEST(Cost, IsTheLargestResidual) {
  const RandomScene scene = MakeRandomScene({});
  for (const double p : {1.0, 1.5, 2.0, 3.0, kInfinity}) {
    double largest = 0;
    for (const Observation& observation : scene.problem.observations) {
      largest = std::max(
          largest,
          ResidualOf(ViewPoint(scene.problem, observation, scene.estimate),
                     Norm{p}));
    }
    EXPECT_GT(largest, 0);
    EXPECT_EQ(Cost(scene.problem, scene.estimate, Norm{p}, 1), largest);
  }
}

TEST(Cost, IsInfiniteIfOnePointIsBehindOneCamera) {
  RandomScene scene = MakeRandomScene({});
  scene.estimate.points.back().z() = -10;
  EXPECT_EQ(Cost(scene.problem, scene.estimate, Norm::L2(), 1), kInfinity);
}

TEST(CostOf, IsTheLargestResidualOfThePoint) {
  const RandomScene scene = MakeRandomScene({});
  double largest = 0;
  for (int32_t k = 0; k < scene.problem.num_points; ++k) {
    double expected = 0;
    for (const Observation& observation : scene.problem.observations) {
      if (observation.point != k) continue;
      expected = std::max(
          expected,
          ResidualOf(ViewPoint(scene.problem, observation, scene.estimate),
                     Norm::L2()));
    }
    EXPECT_EQ(CostOf(scene.problem, scene.estimate, Norm::L2(),
                     scene.problem.OfPoint(k)),
              expected);
    largest = std::max(largest, expected);
  }
  EXPECT_EQ(Cost(scene.problem, scene.estimate, Norm::L2(), 1), largest);
}

TEST(MedianDepth, HasAsManyDepthsBelowAsAbove) {
  const RandomScene scene = MakeRandomScene({});
  const double median = MedianDepth(scene.problem, scene.estimate);
  int64_t below = 0;
  int64_t above = 0;
  for (const Observation& observation : scene.problem.observations) {
    const double depth =
        ViewPoint(scene.problem, observation, scene.estimate).depth;
    below += depth < median;
    above += depth > median;
  }
  EXPECT_GT(below, 0);
  EXPECT_LE(std::abs(below - above), 1);
}

TEST(AllDepthsPositive, IsWhereTheCostIsFinite) {
  const RandomScene scene = MakeRandomScene({});
  EXPECT_TRUE(AllDepthsPositive(scene.problem, scene.estimate, 2));
  for (int32_t k = 0; k < scene.problem.num_points; ++k) {
    Estimate behind = scene.estimate;
    behind.points[k].z() = -10;
    ASSERT_EQ(Cost(scene.problem, behind, Norm::L2(), 1), kInfinity);
    EXPECT_FALSE(AllDepthsPositive(scene.problem, behind, 2));
  }
  // As of rays that go backwards: the row's depth counts, not the camera's z.
  RandomScene turned = scene;
  turned.problem.observations[3].E *= -1;
  ASSERT_EQ(Cost(turned.problem, turned.estimate, Norm::L2(), 1), kInfinity);
  EXPECT_FALSE(AllDepthsPositive(turned.problem, turned.estimate, 2));
}

TEST(Cost, OfNoObservationsIsZero) {
  KnownRotationProblem problem;
  IndexObservations(&problem);
  EXPECT_EQ(Cost(problem, Estimate(), Norm::L2(), 1), 0);
}

TEST(Cost, RefusesAnEstimateOfAnotherSize) {
  RandomScene scene = MakeRandomScene({});
  scene.estimate.points.pop_back();
  EXPECT_THROW(Cost(scene.problem, scene.estimate, Norm::L2(), 1),
               std::invalid_argument);
}

TEST(Cost, RefusesAPowerBelowOne) {
  const RandomScene scene = MakeRandomScene({});
  EXPECT_THROW(Cost(scene.problem, scene.estimate, Norm{0.5}, 1),
               std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
