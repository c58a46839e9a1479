#include "krot/camera/camera_model.h"

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/base/numbers.h"
#include "tests/camera/random_camera.h"

namespace krot::internal {
namespace {

constexpr int kEquirectangular = 17;

Eigen::Vector2d LinearError(const Eigen::Matrix3d& E,
                            const Eigen::Vector3d& x_cam) {
  const Eigen::Vector3d row = E * x_cam;
  return row.tail<2>() / row[0];
}

// How far off the axis points of a model may lie in these tests.
double WidestAngle(int model_id) {
  if (model_id == kEquirectangular) return kPi;
  const bool perspective = model_id <= 4 || model_id == 6;
  if (perspective) return 0.9;
  return model_id == 11 ? 1.3 : 2.2;  // few of 11's random cameras see farther
}

class ProjectionOf : public testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(EveryModel, ProjectionOf, testing::Range(0, 18),
                         [](const auto& model) {
                           return ModelName(model.param);
                         });

TEST_P(ProjectionOf, APointInFrontIsThatOfItsRayToTheBit) {
  if (GetParam() == kEquirectangular) return;
  std::mt19937 random(1);
  for (int trial = 0; trial < 500; ++trial) {
    const RandomCamera camera(GetParam(), &random);
    const Eigen::Vector3d x_cam = 3.7 * RandomBearing(1.55, &random);
    const Eigen::Vector2d expected = camera.Project(x_cam.hnormalized());
    const auto actual =
        ProjectPoint({GetParam(), camera.params().data()}, x_cam);
    ASSERT_EQ(actual.has_value(), expected.allFinite());
    if (actual) {
      EXPECT_EQ(*actual, expected);
    }
  }
}

TEST_P(ProjectionOf, APointDoesNotDependOnItsDistance) {
  std::mt19937 random(2);
  for (int trial = 0; trial < 200; ++trial) {
    const RandomCamera camera(GetParam(), &random);
    const double* params = camera.params().data();
    const Eigen::Vector3d x_cam = RandomBearing(kPi, &random);
    const auto pixel = ProjectPoint({GetParam(), params}, x_cam);
    for (const double scale : {1e-200, 1e-3, 7.0, 1e200}) {
      const auto scaled = ProjectPoint({GetParam(), params}, scale * x_cam);
      ASSERT_EQ(scaled.has_value(), pixel.has_value());
      if (pixel) {
        EXPECT_LT((*scaled - *pixel).norm(), 1e-9 * (1 + pixel->norm()));
      }
    }
  }
}

TEST_P(ProjectionOf, WhatIsNotAPointIsNothing) {
  std::mt19937 random(3);
  const RandomCamera camera(GetParam(), &random);
  const double* params = camera.params().data();
  for (const double bad : {0.0, double{NAN}, HUGE_VAL}) {
    const Eigen::Vector3d x_cam = Eigen::Vector3d::Constant(bad);
    EXPECT_FALSE(ProjectPoint({GetParam(), params}, x_cam));
    EXPECT_FALSE(ProjectionError({GetParam(), params}, {1, 2}, x_cam));
    EXPECT_FALSE(RowAtProjection({GetParam(), params}, {1, 2}, x_cam));
  }
}

TEST_P(ProjectionOf, ABearingIsFoundAgainFromItsPixel) {
  std::mt19937 random(4);
  int num_found = 0;
  int num_lost = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const RandomCamera camera(GetParam(), &random);
    const double* params = camera.params().data();
    const Eigen::Vector3d bearing =
        RandomBearing(WidestAngle(GetParam()), &random);
    const auto pixel = ProjectPoint({GetParam(), params}, bearing);
    if (!pixel) continue;
    const auto found = PixelBearing({GetParam(), params}, *pixel, bearing);
    if (!found) continue;
    EXPECT_NEAR(found->norm(), 1, 1e-15);
    const auto error = ProjectionError({GetParam(), params}, *pixel, *found);
    ASSERT_TRUE(error);
    EXPECT_LT(error->norm(), 2e-8);
    num_found += (*found - bearing).norm() < 1e-6;
    // The same from nothing, if the search arrives (camera_model.h).
    const auto cold = PixelBearing({GetParam(), params}, *pixel);
    num_lost += !cold;
    if (cold) {
      EXPECT_LT((*found - *cold).norm(), 1e-6);
    }
  }
  EXPECT_GT(num_found, 100);
  EXPECT_LE(num_lost, GetParam() == 11 ? 1 : 0);
}

TEST_P(ProjectionOf, ARowIsTheTrueErrorAtItsPoint) {
  std::mt19937 random(5);
  int num_rows = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const RandomCamera camera(GetParam(), &random);
    const double* params = camera.params().data();
    const Eigen::Vector3d x_hat = 5 * RandomBearing(kPi, &random);
    const Eigen::Vector2d pixel(1000 * RandomRay(3, &random));
    const auto row = RowAtProjection({GetParam(), params}, pixel, x_hat);
    const auto error = ProjectionError({GetParam(), params}, pixel, x_hat);
    if (!row) continue;
    ++num_rows;
    ASSERT_TRUE(error);
    EXPECT_GT(row->row(0) * x_hat, 0);
    const double rounding =
        1e-15 * row->norm() * x_hat.norm() / (row->row(0) * x_hat);
    EXPECT_LT((LinearError(*row, x_hat) - *error).norm(), 10 * rounding);
  }
  EXPECT_GT(num_rows, 100);
}

// |true - linear error| at a distance h from x_hat falls as h^2, and central
// differences of both agree.
TEST_P(ProjectionOf, ARowIsOfFirstOrderAroundItsPoint) {
  std::mt19937 random(6);
  int num_rows = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const RandomCamera camera(GetParam(), &random);
    const double* params = camera.params().data();
    const Eigen::Vector3d x_hat =
        RandomBearing(WidestAngle(GetParam()), &random);
    const auto at = ProjectPoint({GetParam(), params}, x_hat);
    if (!at) continue;
    const Eigen::Vector2d pixel = *at + RandomRay(20, &random);
    const auto row = RowAtProjection({GetParam(), params}, pixel, x_hat);
    if (!row || row->norm() > 1e5) continue;  // DIVISION's last ray, a pole
    ++num_rows;
    const Eigen::Vector3d direction = RandomBearing(kPi, &random);
    const auto difference = [&](double h) -> Eigen::Vector2d {
      const auto ahead =
          ProjectionError({GetParam(), params}, pixel, x_hat + h * direction);
      const auto behind =
          ProjectionError({GetParam(), params}, pixel, x_hat - h * direction);
      if (!ahead || !behind) return {NAN, NAN};
      return (*ahead - *behind) / (2 * h) -
             (LinearError(*row, x_hat + h * direction) -
              LinearError(*row, x_hat - h * direction)) /
                 (2 * h);
    };
    const double error = difference(1e-5).norm();
    if (std::isnan(error)) continue;
    EXPECT_LT(error, 1e-6 * row->norm() + 2 * difference(1e-4).norm() / 50);
  }
  EXPECT_GT(num_rows, 150);
}

TEST(RowAtProjection, OnTheImagePlaneIsThatOfTheDesign) {
  std::mt19937 random(7);
  for (const int id : {0, 1, 2, 3, 4, 6, 12, 13}) {
    const RandomCamera camera(id, &random);
    const double* params = camera.params().data();
    const Eigen::Vector2d u(0.1, -0.07);
    const Eigen::Vector2d pixel(400, 300);
    const auto row = RowAtProjection({id, params}, pixel, 3 * u.homogeneous());
    ASSERT_TRUE(row);
    const Eigen::Matrix2d J = ProjectionJacobian({id, params}, u);
    Eigen::Matrix3d expected;
    expected.row(0) = Eigen::RowVector3d::UnitZ();
    expected.bottomRows<2>() << J, ProjectRay({id, params}, u) - pixel - J * u;
    EXPECT_LT((*row - expected).norm(), 1e-11 * expected.norm());
  }
}

TEST(RowAtProjection, OfAPinholeDoesNotDependOnThePoint) {
  const double params[] = {1000, 900, 320, 240};
  const Eigen::Vector2d pixel(300, 200);
  const auto a = RowAtProjection({1, params}, pixel, {0.1, 0.2, 1});
  const auto b = RowAtProjection({1, params}, pixel, {-0.3, 0.1, 0.5});
  ASSERT_TRUE(a && b);
  EXPECT_LT((*a - *b).norm(), 1e-12);
  EXPECT_FALSE(RowAtProjection({1, params}, pixel, {0.1, 0.2, -1}));
  EXPECT_FALSE(RowAtProjection({1, params}, pixel, {0.1, 0.2, 0}));
}

TEST(ProjectPoint, OfFisheyesGoesOnWithTheAngleBeyondNinetyDegrees) {
  const double fisheye[] = {100, 10, 20};
  const double fov[] = {100, 100, 10, 20, 0.9};
  const double stretch = 2 * std::tan(0.45);
  for (int degrees = 1; degrees < 180; ++degrees) {
    const double theta = degrees * kPi / 180;
    const Eigen::Vector2d direction(std::cos(0.7), std::sin(0.7));
    Eigen::Vector3d x_cam;
    x_cam << std::sin(theta) * direction, std::cos(theta);
    const Eigen::Vector2d center(10, 20);
    const auto pixel = ProjectPoint({14, fisheye}, x_cam);
    ASSERT_TRUE(pixel);
    EXPECT_LT((*pixel - center - 100 * theta * direction).norm(), 1e-12);
    const double angle = std::atan2(stretch * std::sin(theta), std::cos(theta));
    const auto fov_pixel = ProjectPoint({7, fov}, x_cam);
    ASSERT_TRUE(fov_pixel);
    EXPECT_LT((*fov_pixel - center - 100 * angle / 0.9 * direction).norm(),
              1e-12);
  }
  EXPECT_FALSE(ProjectPoint({14, fisheye}, {0, 0, -1}));
}

TEST(ProjectPoint, OfDivisionAndEucmIsTheInverseOfTheirRay) {
  // (a, b) = (3, 4) / 2: the ray is (a, b, 1 - 0.25 * 6.25), behind z = 0.
  const double division[] = {100, 10, 20, -0.25};
  const auto pixel = ProjectPoint({12, division}, {1.5, 2, 1 - 0.25 * 6.25});
  ASSERT_TRUE(pixel);
  EXPECT_LT((*pixel - Eigen::Vector2d(160, 220)).norm(), 1e-11);
  const double barrel[] = {100, 10, 20, 0.25};
  EXPECT_FALSE(ProjectPoint({12, barrel}, {0.1, 0.2, -1}));
  // alpha = 1/2, beta = 1 is the stereographic lens, 2 tan(theta / 2).
  const double eucm[] = {100, 100, 10, 20, 0.5, 1};
  const auto wide = ProjectPoint({16, eucm}, {std::sin(2.0), 0, std::cos(2.0)});
  ASSERT_TRUE(wide);
  EXPECT_NEAR(wide->x(), 10 + 200 * std::tan(1.0), 1e-10);
  const double pinhole[] = {100, 100, 10, 20, 0, 1};
  EXPECT_FALSE(ProjectPoint({16, pinhole}, {0.1, 0, -1}));
}

TEST(ProjectPoint, OfAPanoramaIsItsAzimuthAndElevation) {
  const double params[] = {3600, 1800};
  const auto at = [&](double x, double y, double z) {
    return *ProjectPoint({kEquirectangular, params}, {x, y, z});
  };
  EXPECT_LT((at(0, 0, 1) - Eigen::Vector2d(1800, 900)).norm(), 1e-9);
  EXPECT_LT((at(1, 0, 0) - Eigen::Vector2d(2700, 900)).norm(), 1e-9);
  EXPECT_LT((at(-1, 0, -1) - Eigen::Vector2d(450, 900)).norm(), 1e-9);
  EXPECT_LT((at(0, 1, 1) - Eigen::Vector2d(1800, 1350)).norm(), 1e-9);
}

TEST(ProjectionError, OfAPanoramaTakesTheShorterWayAcrossTheSeam) {
  const double params[] = {3600, 1800};
  // One degree, 10 px, left of the seam; the pixel 4 px right of it.
  const Eigen::Vector3d x_cam(std::sin(kPi - kPi / 180), 0,
                              std::cos(kPi - kPi / 180));
  const auto error =
      ProjectionError({kEquirectangular, params}, {4, 900}, x_cam);
  ASSERT_TRUE(error);
  EXPECT_LT((*error - Eigen::Vector2d(-14, 0)).norm(), 1e-9);
}

TEST(RowAtProjection, OfAPanoramaDoesNotMindTheSeam) {
  const double params[] = {3600, 1800};
  const Eigen::Vector3d left(1e-3, 0.3, -1), right(-1e-3, 0.3, -1);
  const Eigen::Vector2d pixel(3, 1000);
  const auto row = RowAtProjection({kEquirectangular, params}, pixel, left);
  ASSERT_TRUE(row);
  const auto error = ProjectionError({kEquirectangular, params}, pixel, right);
  EXPECT_LT((LinearError(*row, right) - *error).norm(), 1e-3);
}

TEST(RowAtProjection, OfAnUnknownModelThrows) {
  const double params[] = {1, 1};
  EXPECT_THROW(RowAtProjection({18, params}, {0, 0}, {0, 0, 1}),
               std::invalid_argument);
}

TEST(ChartAt, IsTheImagePlaneForPerspectiveLensesAndTangentForFisheyes) {
  std::mt19937 random(8);
  const Eigen::Vector3d x_cam(0.3, 0.2, 0.9);
  for (int id = 0; id < 18; ++id) {
    const RandomCamera camera(id, &random);
    const auto chart = ChartAt({id, camera.params().data()}, x_cam);
    if (!chart) continue;  // DIVISION's last ray
    const bool on_plane = id <= 4 || id == 6 || id == 12 || id == 13;
    EXPECT_EQ(chart->n == Eigen::Vector3d::UnitZ(), on_plane);
    if (!on_plane) {
      EXPECT_LT((chart->n - x_cam.normalized()).norm(), 1e-15);
    }
    EXPECT_LT(
        (chart->B.transpose() * chart->B - Eigen::Matrix2d::Identity()).norm(),
        1e-15);
    EXPECT_LT((chart->n.transpose() * chart->B).norm(), 1e-15);
  }
}

}  // namespace
}  // namespace krot::internal
