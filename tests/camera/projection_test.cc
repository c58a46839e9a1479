#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/camera/interval.h"
#include "krot/camera/models.h"
#include "tests/camera/random_camera.h"

namespace krot::internal {
namespace {

Eigen::Vector2d Project(std::string_view name,
                        const std::vector<double>& params,
                        const Eigen::Vector2d& u) {
  const CameraModelInfo& model = *FindCameraModel(name);
  EXPECT_EQ(static_cast<size_t>(model.num_params), params.size()) << name;
  return ProjectRay({model.id, params.data()}, u);
}

void ExpectSamePixel(const Eigen::Vector2d& actual,
                     const Eigen::Vector2d& expected) {
  EXPECT_NEAR(actual.x(), expected.x(), 1e-10);
  EXPECT_NEAR(actual.y(), expected.y(), 1e-10);
}

// Rays over the image and, for wide lenses, to 80 degrees.
std::vector<Eigen::Vector2d> SomeRays() {
  std::mt19937 random(1);
  std::vector<Eigen::Vector2d> rays = {{0, 0}, {1e-9, 0}, {0.03, -0.01}};
  for (int i = 0; i < 50; ++i) rays.push_back(RandomRay(5.7, &random));
  return rays;
}

TEST(Projection, OfTheAxisIsThePrincipalPoint) {
  std::mt19937 random(2);
  for (const int id : ImagePlaneModelIds()) {
    const RandomCamera camera(id, &random);
    const bool one_focal = FindCameraModel(id)->param_names[1] == ',';
    const double* center = camera.params().data() + (one_focal ? 1 : 2);
    const Eigen::Vector2d pixel = camera.Project({0, 0});
    EXPECT_EQ(pixel.x(), center[0]) << ModelName(id);
    EXPECT_EQ(pixel.y(), center[1]) << ModelName(id);
  }
}

TEST(Projection, FollowsTheEquationsOfTheRadialModels) {
  // s = 0.09 + 0.16 = 0.25
  const Eigen::Vector2d u(0.3, 0.4);
  ExpectSamePixel(Project("SIMPLE_PINHOLE", {100, 10, 20}, u), {40, 60});
  ExpectSamePixel(Project("PINHOLE", {100, 200, 10, 20}, u), {40, 100});
  ExpectSamePixel(Project("SIMPLE_RADIAL", {100, 10, 20, 0.4}, u), {43, 64});
  ExpectSamePixel(Project("RADIAL", {100, 10, 20, 0.4, 1.6}, u), {46, 68});
  // Tangential: 2 p1 a b + p2 (s + 2 a^2) = 0.24 p1 + 0.43 p2.
  ExpectSamePixel(Project("OPENCV", {100, 100, 10, 20, 0.4, 1.6, 0.1, 0.2}, u),
                  {46 + 2.4 + 8.6, 68 + 0.24 * 20 + 0.57 * 10});
  // (1 + 0.4 s + 1.6 s^2 + 6.4 s^3) / (1 + 4 s + 16 s^2 + 64 s^3) = 1.3 / 4
  ExpectSamePixel(
      Project("FULL_OPENCV", {100, 100, 10, 20, 0.4, 1.6, 0, 0, 6.4, 4, 16, 64},
              u),
      {10 + 30 * 1.3 / 4, 20 + 40 * 1.3 / 4});
}

TEST(Projection, OfThePlainFisheyeIsProportionalToTheAngle) {
  for (int degrees = 1; degrees < 90; ++degrees) {
    const double theta = degrees * kPi / 180;
    const Eigen::Vector2d u =
        std::tan(theta) * Eigen::Vector2d(std::cos(0.7), std::sin(0.7));
    const Eigen::Vector2d expected(10 + 100 * theta * std::cos(0.7),
                                   20 + 100 * theta * std::sin(0.7));
    ExpectSamePixel(Project("SIMPLE_FISHEYE", {100, 10, 20}, u), expected);
  }
}

TEST(Projection, OfTheFisheyeFamilyNests) {
  for (const Eigen::Vector2d& u : SomeRays()) {
    const Eigen::Vector2d plain = Project("FISHEYE", {99, 98, 10, 20}, u);
    ExpectSamePixel(Project("OPENCV_FISHEYE", {99, 98, 10, 20, 0, 0, 0, 0}, u),
                    plain);
    ExpectSamePixel(Project("SIMPLE_RADIAL_FISHEYE", {99, 10, 20, 0}, u),
                    Project("SIMPLE_FISHEYE", {99, 10, 20}, u));
    ExpectSamePixel(Project("RADIAL_FISHEYE", {99, 10, 20, .1, 0}, u),
                    Project("SIMPLE_RADIAL_FISHEYE", {99, 10, 20, .1}, u));
    const Eigen::Vector2d radial =
        Project("OPENCV_FISHEYE", {99, 98, 10, 20, .1, .2, .3, .4}, u);
    ExpectSamePixel(Project("THIN_PRISM_FISHEYE",
                            {99, 98, 10, 20, .1, .2, 0, 0, .3, .4, 0, 0}, u),
                    radial);
    ExpectSamePixel(
        Project("RAD_TAN_THIN_PRISM_FISHEYE",
                {99, 98, 10, 20, .1, .2, .3, .4, 0, 0, 0, 0, 0, 0, 0, 0}, u),
        radial);
    // Without radial terms: p0 is THIN_PRISM_FISHEYE's p2, p1 its p1.
    ExpectSamePixel(
        Project("RAD_TAN_THIN_PRISM_FISHEYE",
                {99, 98, 10, 20, 0, 0, 0, 0, 0, 0, .1, .2, .3, 0, .4, 0}, u),
        Project("THIN_PRISM_FISHEYE",
                {99, 98, 10, 20, 0, 0, .2, .1, 0, 0, .3, .4}, u));
  }
}

TEST(Projection, OfRadTanThinPrismActsOnTheRadiallyDistortedPoint) {
  // At 45 degrees on the x axis, a' = theta (1 + sum k_i theta^(2i + 2)), and
  // x = a' + (3 p0 + s0) a'^2 + s1 a'^4, y = (p1 + s2) a'^2 + s3 a'^4.
  const double theta = kPi / 4;
  double a = theta;
  for (int i = 0; i < 6; ++i) a += 0.01 * (i + 1) * std::pow(theta, 2 * i + 3);
  const double a2 = a * a;
  ExpectSamePixel(Project("RAD_TAN_THIN_PRISM_FISHEYE",
                          {100, 200, 10, 20, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06,
                           0.1, 0.2, 0.3, 0.4, 0.5, 0.6},
                          {1, 0}),
                  {10 + 100 * (a + 0.6 * a2 + 0.4 * a2 * a2),
                   20 + 200 * (0.7 * a2 + 0.6 * a2 * a2)});
}

TEST(Projection, OfTheFovModelFollowsItsEquation) {
  const double omega = 0.9;
  const double r = 1 / (2 * std::tan(omega / 2));  // atan(2 r tan) = pi / 4
  const Eigen::Vector2d expected(10 + 100 * kPi / (4 * omega), 20);
  ExpectSamePixel(Project("FOV", {100, 100, 10, 20, omega}, {r, 0}), expected);
  ExpectSamePixel(Project("FOV", {100, 100, 10, 20, -omega}, {r, 0}), expected);
}

TEST(Projection, OfTheFovModelWithSmallOmegaIsColmapsPolynomial) {
  const double scale = 1 + 1e-6 * (0.25 / 3 - 1.0 / 12);
  ExpectSamePixel(Project("FOV", {100, 100, 10, 20, 1e-3}, {0.3, 0.4}),
                  {10 + 30 * scale, 20 + 40 * scale});
}

TEST(Projection, OfTheDivisionModelHasTheRayOfItsDefinition) {
  for (const double k : {-0.3, -1e-12, 0.0, 0.005}) {
    for (const Eigen::Vector2d& u : SomeRays()) {
      const Eigen::Vector2d a = Project("DIVISION", {1, 1, 0, 0, k}, u);
      ExpectSamePixel(a / (1 + k * a.squaredNorm()), u);
      ExpectSamePixel(Project("SIMPLE_DIVISION", {1, 0, 0, k}, u), a);
    }
  }
}

TEST(Projection, OfTheDivisionModelWithoutDistortionIsThePinhole) {
  for (const Eigen::Vector2d& u : SomeRays()) {
    EXPECT_EQ(Project("DIVISION", {300, 200, 10, 20, 0}, u),
              Project("PINHOLE", {300, 200, 10, 20}, u));
  }
}

TEST(Projection, OfTheDivisionModelIsNotFiniteWhereNoPixelHasTheRay) {
  EXPECT_FALSE(Project("DIVISION", {1, 1, 0, 0, 0.3}, {1, 0}).allFinite());
}

TEST(Projection, OfEucmIsThePinholeAtAlphaZeroAndStereographicAtOneHalf) {
  for (const Eigen::Vector2d& u : SomeRays()) {
    ExpectSamePixel(Project("EUCM", {300, 200, 10, 20, 0, 1.3}, u),
                    Project("PINHOLE", {300, 200, 10, 20}, u));
    const double r = u.norm();
    if (r == 0) continue;
    // alpha = 1/2, beta = 1: |(a, b)| = 2 tan(theta / 2).
    ExpectSamePixel(Project("EUCM", {1, 1, 0, 0, 0.5, 1}, u),
                    2 * std::tan(std::atan(r) / 2) / r * u);
  }
}

TEST(Projection, OfEucmFollowsItsEquation) {
  // rho = sqrt(1 + 3 * 1) = 2 at |u| = 1; 0.25 * 2 + 0.75 = 1.25
  ExpectSamePixel(Project("EUCM", {100, 100, 10, 20, 0.25, 3}, {0.6, 0.8}),
                  {10 + 48, 20 + 64});
}

TEST(Projection, IsSmoothWhereTheSeriesNearTheAxisEnds) {
  // z^2 = 1e-3 in AtanOverRoot.
  const double r = std::sqrt(1e-3);
  for (const double z : {r * (1 - 1e-15), r * (1 + 1e-15)}) {
    EXPECT_NEAR(AtanOverRoot(z * z), std::atan(z) / z, 3e-16);
  }
}

TEST(ProjectionJacobian, AgreesWithCentralDifferences) {
  std::mt19937 random(3);
  for (const int id : ImagePlaneModelIds()) {
    for (int trial = 0; trial < 200; ++trial) {
      const RandomCamera camera(id, &random);
      const Eigen::Vector2d u = RandomRay(0.9, &random);
      const Eigen::Matrix2d expected = camera.NumericJacobian(u);
      if (!expected.allFinite()) continue;  // beyond DIVISION's last ray
      const Eigen::Matrix2d J =
          ProjectionJacobian({id, camera.params().data()}, u);
      EXPECT_LT((J - expected).norm(), 1e-6 * (1 + J.norm())) << ModelName(id);
    }
  }
}

TEST(ProjectionJacobian, IsExactOnTheAxis) {
  std::mt19937 random(4);
  for (const int id : ImagePlaneModelIds()) {
    const RandomCamera camera(id, &random);
    const Eigen::Matrix2d J =
        ProjectionJacobian({id, camera.params().data()}, {0, 0});
    ASSERT_TRUE(J.allFinite()) << ModelName(id);
    EXPECT_EQ(J(0, 1), 0) << ModelName(id);
    EXPECT_EQ(J(1, 0), 0) << ModelName(id);
    if (id == Fov::kId) continue;  // 2 tan(omega / 2) / omega there
    EXPECT_DOUBLE_EQ(J(0, 0), camera.params()[0]) << ModelName(id);
  }
}

TEST(Project, AlsoDifferentiatesByTheParameters) {
  // k is the variable: d pixel / d k = f u r^2 for SIMPLE_RADIAL, and FOV
  // takes the derivative through tan(omega / 2).
  using D = Dual<double>;
  const D params[] = {{100, 0, 0}, {10, 0, 0}, {20, 0, 0}, {0.1, 1, 0}};
  D x, y;
  SimpleRadial::Project(params, D{0.3, 0, 0}, D{0.4, 0, 0}, &x, &y);
  EXPECT_NEAR(x.du, 100 * 0.3 * 0.25, 1e-12);
  EXPECT_NEAR(y.du, 100 * 0.4 * 0.25, 1e-12);
}

TEST(CameraModels, AreEighteenInTheOrderOfTheirIds) {
  ASSERT_EQ(CameraModels().size(), 18u);
  for (int id = 0; id < 18; ++id) EXPECT_EQ(CameraModels()[id].id, id);
}

TEST(CameraModels, HaveAsManyParametersAsNames) {
  for (const CameraModelInfo& info : CameraModels()) {
    const auto commas =
        std::count(info.param_names.begin(), info.param_names.end(), ',');
    EXPECT_EQ(info.num_params, commas + 1) << info.name;
  }
}

TEST(CameraModels, AreFoundByIdAndByName) {
  for (const CameraModelInfo& info : CameraModels()) {
    EXPECT_EQ(FindCameraModel(info.id), &info);
    EXPECT_EQ(FindCameraModel(info.name), &info);
  }
}

TEST(CameraModels, UnknownOnesAreNotFound) {
  EXPECT_EQ(FindCameraModel(-1), nullptr);
  EXPECT_EQ(FindCameraModel(18), nullptr);
  EXPECT_EQ(FindCameraModel("SIMPLE_RADIAL "), nullptr);
  EXPECT_EQ(FindCameraModel(""), nullptr);
}

TEST(CameraModels, OnlyEquirectangularHasNoImagePlane) {
  for (const CameraModelInfo& info : CameraModels()) {
    EXPECT_EQ(info.has_image_plane, info.name != "EQUIRECTANGULAR");
  }
}

TEST(CameraModels, WithoutImagePlaneAreRefusedByNameOfTheArgument) {
  const double params[] = {2000, 1000};
  try {
    ProjectRay({Equirectangular::kId, params}, {0, 0});
    FAIL() << "EQUIRECTANGULAR was projected";
  } catch (const std::invalid_argument& error) {
    EXPECT_THAT(error.what(), testing::StartsWith("model_id = 17, must be"));
  }
  EXPECT_THROW(ProjectionJacobian({18, params}, {0, 0}), std::invalid_argument);
  EXPECT_THROW(UndistortPixel({-1, params}, {0, 0}), std::invalid_argument);
}

TEST(VisitCameraModel, CallsTheVisitorWithTheModelOfTheId) {
  for (int id = 0; id <= Eucm::kId; ++id) {
    const int visited =
        VisitCameraModel(id, [](auto model) { return decltype(model)::kId; });
    EXPECT_EQ(visited, id);
  }
}

}  // namespace
}  // namespace krot::internal
