#include <cmath>
#include <optional>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/camera/models.h"
#include "tests/camera/random_camera.h"

namespace krot::internal {
namespace {

std::optional<UndistortedObservation> Undistort(
    int model_id, const std::vector<double>& params,
    const Eigen::Vector2d& pixel) {
  return UndistortPixel({model_id, params.data()}, pixel);
}

// What UndistortedObservation promises.
void ExpectConsistent(const RandomCamera& camera,
                      const UndistortedObservation& observation,
                      const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d& u = observation.u;
  EXPECT_LE((camera.Project(u) - pixel).norm(), 1e-8);
  EXPECT_GT(observation.J.determinant(), 0);
  EXPECT_GT(camera.SmallestDeterminant(u), -1e-6);
  EXPECT_LT((observation.J - camera.NumericJacobian(u)).norm(),
            1e-5 * (1 + observation.J.norm()));
}

class EveryModel : public testing::TestWithParam<int> {};

INSTANTIATE_TEST_SUITE_P(UndistortPixel, EveryModel,
                         testing::ValuesIn(ImagePlaneModelIds()),
                         [](const auto& model) {
                           return ModelName(model.param);
                         });

TEST_P(EveryModel, InvertsTheProjectionBeforeTheFold) {
  std::mt19937 random(6);
  int num_before_fold = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const RandomCamera camera(GetParam(), &random);
    for (int i = 0; i < 20; ++i) {
      const Eigen::Vector2d u = RandomRay(1.5, &random);
      if (!(camera.SmallestDeterminant(u) > 1e-3)) continue;
      ++num_before_fold;
      const Eigen::Vector2d pixel = camera.Project(u);
      const auto observation = Undistort(GetParam(), camera.params(), pixel);
      ASSERT_TRUE(observation);
      ExpectConsistent(camera, *observation, pixel);
      EXPECT_LT((observation->J * (observation->u - u)).norm(), 1e-8);
    }
  }
  EXPECT_GT(num_before_fold, 400);
}

TEST_P(EveryModel, RefusesNumbersThatAreNotFinite) {
  std::mt19937 random(9);
  const RandomCamera camera(GetParam(), &random);
  for (const Eigen::Vector2d& pixel :
       {Eigen::Vector2d(NAN, 0), Eigen::Vector2d(0, HUGE_VAL)}) {
    EXPECT_FALSE(Undistort(GetParam(), camera.params(), pixel));
  }
  std::vector<double> params = camera.params();
  params.back() = NAN;
  EXPECT_FALSE(Undistort(GetParam(), params, camera.Project({0.1, 0.1})));
}

TEST_P(EveryModel, RefusesAMirroredCamera) {
  std::mt19937 random(10);
  const RandomCamera camera(GetParam(), &random);
  if (FindCameraModel(GetParam())->param_names[1] == ',') return;  // one focal
  std::vector<double> params = camera.params();
  params[0] = -params[0];  // det J < 0 everywhere
  const Eigen::Vector2d pixel =
      ProjectRay({GetParam(), params.data()}, {0.1, 0.1});
  EXPECT_FALSE(Undistort(GetParam(), params, pixel));
}

TEST(UndistortPixel, OfAPinholeIsExact) {
  const std::vector<double> params = {1024, 512, 320, 240};
  const auto observation = Undistort(Pinhole::kId, params, {321.5, 100.25});
  ASSERT_TRUE(observation);
  EXPECT_EQ(observation->u, Eigen::Vector2d(1.5 / 1024, -139.75 / 512));
  EXPECT_EQ(observation->J,
            Eigen::Matrix2d(Eigen::Vector2d(1024, 512).asDiagonal()));
}

// SIMPLE_RADIAL with k = -0.3 folds at r^2 = 1 / 0.9, where the image radius
// is 2/3 r = 0.7027; no pixel farther out has a ray.
class SimpleRadialFold : public testing::Test {
 protected:
  const std::vector<double> params_ = {1000, 0, 0, -0.3};
  const double fold_px_ = 1000 * 2 / 3.0 / std::sqrt(0.9);
};

TEST_F(SimpleRadialFold, PixelsBeyondItHaveNoRay) {
  for (const double radius : {fold_px_ + 1e-3, 800.0, 1e4}) {
    EXPECT_FALSE(Undistort(SimpleRadial::kId, params_, {radius, 0}));
  }
}

TEST_F(SimpleRadialFold, PixelsJustInsideItHaveOne) {
  const Eigen::Vector2d pixel(0.6 * (fold_px_ - 1e-3), 0.8 * (fold_px_ - 1e-3));
  const auto observation = Undistort(SimpleRadial::kId, params_, pixel);
  ASSERT_TRUE(observation);
  EXPECT_LT(observation->u.norm(), 1 / std::sqrt(0.9));
}

TEST_F(SimpleRadialFold, ARayThatReproducesThePixelBeyondItIsNotTaken) {
  const Eigen::Vector2d beyond(1.5, 0);    // projects exactly, det J < 0
  const Eigen::Vector2d farther(-2.2, 0);  // x = 0.994, det J > 0 but not
                                           // all the way from the axis
  for (const Eigen::Vector2d& ray : {beyond, farther}) {
    const Eigen::Vector2d pixel =
        ProjectRay({SimpleRadial::kId, params_.data()}, ray);
    const auto found = PixelBearing({SimpleRadial::kId, params_.data()}, pixel,
                                    Eigen::Vector3d(ray.homogeneous()));
    ASSERT_EQ(found.has_value(), !(pixel.norm() > fold_px_));
    if (!found) continue;
    EXPECT_LT(found->hnormalized().norm(), 1 / std::sqrt(0.9));
    EXPECT_GT(found->hnormalized().dot(pixel), 0);
  }
}

// The image radius of the rays 90 degrees off the axis, by each model's
// equation, with all focal lengths 1000 and the centre (0, 0).
struct WideCamera {
  int model_id;
  std::vector<double> params;
  double horizon_px;
};

std::vector<WideCamera> WideCameras() {
  const double t = kPi / 2;
  return {
      {SimpleFisheye::kId, {1000, 0, 0}, 1000 * t},
      {Fisheye::kId, {1000, 1000, 0, 0}, 1000 * t},
      {SimpleRadialFisheye::kId, {1000, 0, 0, .1}, 1000 * (t + .1 * t * t * t)},
      {RadialFisheye::kId,
       {1000, 0, 0, .1, .01},
       1000 * (t + .1 * t * t * t + .01 * std::pow(t, 5))},
      {OpenCvFisheye::kId,
       {1000, 1000, 0, 0, -.02, 0, 0, 0},
       1000 * (t - .02 * t * t * t)},
      {Fov::kId, {1000, 1000, 0, 0, 0.8}, 1000 * t / 0.8},
      {SimpleDivision::kId, {1000, 0, 0, -0.2}, 1000 / std::sqrt(0.2)},
      {Division::kId, {1000, 1000, 0, 0, -0.2}, 1000 / std::sqrt(0.2)},
      {Eucm::kId, {1000, 1000, 0, 0, 0.6, 1.2}, 1000 / (0.6 * std::sqrt(1.2))},
  };
}

TEST(UndistortPixel, FindsRaysUpToNinetyDegreesAndNoneBeyond) {
  for (const WideCamera& camera : WideCameras()) {
    const auto observation = Undistort(camera.model_id, camera.params,
                                       {0, camera.horizon_px - 0.01});
    ASSERT_TRUE(observation) << ModelName(camera.model_id);
    EXPECT_GT(observation->u.y(), 50) << ModelName(camera.model_id);
    EXPECT_FALSE(Undistort(camera.model_id, camera.params,
                           {0, camera.horizon_px + 0.01}))
        << ModelName(camera.model_id);
  }
}

TEST(UndistortPixel, FindsNoneForAPanorama) {
  EXPECT_FALSE(Undistort(Equirectangular::kId, {2000, 1000}, {1000, 500}));
}

TEST(UndistortPixel, OfAFisheyeThatFoldsBeforeNinetyDegreesFailsThere) {
  // theta - 0.3 theta^3 is largest at theta = 1.054: 702.7 px.
  const std::vector<double> params = {1000, 0, 0, -0.3};
  EXPECT_TRUE(Undistort(SimpleRadialFisheye::kId, params, {702, 0}));
  EXPECT_FALSE(Undistort(SimpleRadialFisheye::kId, params, {704, 0}));
}

TEST(UndistortPixel, OfADivisionModelWithPositiveKEndsAtItsLastPixel) {
  const std::vector<double> params = {1000, 1000, 0, 0, 0.25};  // r = 1 / 0.5
  EXPECT_TRUE(Undistort(Division::kId, params, {1990, 0}));
  EXPECT_FALSE(Undistort(Division::kId, params, {2010, 0}));
}

TEST(UndistortPixel, DoesNotCrossThePoleOfARationalDistortion) {
  // Denominator 1 - 4 s: |x| = r / (1 - 4 r^2) takes every value on either
  // side of r = 1/2, and only the inner side belongs to the pixel.
  const std::vector<double> params = {1000, 1000, 0, 0,  0, 0,
                                      0,    0,    0, -4, 0, 0};
  for (const Eigen::Vector2d& beyond :
       {Eigen::Vector2d(0.6, 0), Eigen::Vector2d(0, 2)}) {
    const Eigen::Vector2d pixel =
        ProjectRay({FullOpenCv::kId, params.data()}, beyond);
    const auto observation = Undistort(FullOpenCv::kId, params, pixel);
    ASSERT_TRUE(observation);
    EXPECT_LT(observation->u.norm(), 0.5);
    const auto bearing = PixelBearing({FullOpenCv::kId, params.data()}, pixel,
                                      Eigen::Vector3d(beyond.homogeneous()));
    ASSERT_TRUE(bearing);
    EXPECT_LT(bearing->hnormalized().norm(), 0.5);
  }
}

TEST(UndistortPixel, OfTheFovModelInvertsTheSmallOmegaPolynomial) {
  const std::vector<double> params = {1000, 1000, 0, 0, 5e-3};
  for (const double r : {0.0, 1e-6, 0.4, 3.0, 1e3}) {
    const Eigen::Vector2d pixel = ProjectRay({Fov::kId, params.data()}, {r, 0});
    const auto observation = Undistort(Fov::kId, params, pixel);
    ASSERT_TRUE(observation) << r;
    EXPECT_NEAR(observation->u.x(), r, 1e-12 * (1 + r));
  }
}

}  // namespace
}  // namespace krot::internal
