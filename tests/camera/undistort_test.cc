#include <cmath>
#include <optional>
#include <random>

#include <gtest/gtest.h>
#include <Eigen/LU>

#include "krot/camera/camera_model.h"
#include "krot/camera/models.h"
#include "tests/camera/random_camera.h"

namespace krot::internal {
namespace {

constexpr double kPi = 3.14159265358979323846;

struct Outcome {
  UndistortStatus status;
  UndistortedObservation observation;
};

Outcome Undistort(int model_id, const std::vector<double>& params,
                  const Eigen::Vector2d& pixel,
                  const std::optional<Eigen::Vector2d>& start = {}) {
  Outcome outcome;
  outcome.status = UndistortPixel(model_id, params.data(), pixel, start,
                                  &outcome.observation);
  return outcome;
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
      const Outcome outcome = Undistort(GetParam(), camera.params(), pixel);
      ASSERT_EQ(outcome.status, UndistortStatus::kOk);
      ExpectConsistent(camera, outcome.observation, pixel);
      const Eigen::Vector2d error = outcome.observation.u - u;
      EXPECT_LT((outcome.observation.J * error).norm(), 1e-8);
    }
  }
  EXPECT_GT(num_before_fold, 400);
}

TEST_P(EveryModel, GivesTheSameAnswerFromEveryStart) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 100; ++trial) {
    const RandomCamera camera(GetParam(), &random);
    // Rays before and beyond folds, then pixels that may have no ray at all.
    const Eigen::Vector2d u = RandomRay(3, &random);
    Eigen::Vector2d pixel = camera.Project(u);
    if (trial % 2 || !pixel.allFinite()) pixel = 4000 * RandomRay(1, &random);

    const Outcome expected = Undistort(GetParam(), camera.params(), pixel);
    if (expected.status == UndistortStatus::kOk) {
      ExpectConsistent(camera, expected.observation, pixel);
    }
    for (const double radius : {0.5, 2.0, 10.0, 1e3}) {
      for (const Eigen::Vector2d& start :
           {u, RandomRay(radius, &random), RandomRay(radius, &random)}) {
        const Outcome actual =
            Undistort(GetParam(), camera.params(), pixel, start);
        ASSERT_EQ(actual.status, expected.status);
        if (actual.status != UndistortStatus::kOk) continue;
        const Eigen::Vector2d change =
            actual.observation.u - expected.observation.u;
        EXPECT_LT((expected.observation.J * change).norm(), 1e-8);
      }
    }
  }
}

TEST_P(EveryModel, IgnoresAStartThatIsNotFinite) {
  std::mt19937 random(8);
  const RandomCamera camera(GetParam(), &random);
  const Eigen::Vector2d pixel = camera.Project({0.1, -0.2});
  const Outcome expected = Undistort(GetParam(), camera.params(), pixel);
  const Outcome actual = Undistort(GetParam(), camera.params(), pixel,
                                   Eigen::Vector2d(NAN, HUGE_VAL));
  ASSERT_EQ(actual.status, UndistortStatus::kOk);
  EXPECT_EQ(actual.observation.u, expected.observation.u);
}

TEST_P(EveryModel, RefusesNumbersThatAreNotFinite) {
  std::mt19937 random(9);
  const RandomCamera camera(GetParam(), &random);
  for (const Eigen::Vector2d& pixel :
       {Eigen::Vector2d(NAN, 0), Eigen::Vector2d(0, HUGE_VAL)}) {
    EXPECT_NE(Undistort(GetParam(), camera.params(), pixel).status,
              UndistortStatus::kOk);
  }
  std::vector<double> params = camera.params();
  params.back() = NAN;
  EXPECT_EQ(Undistort(GetParam(), params, camera.Project({0.1, 0.1})).status,
            UndistortStatus::kNotConverged);
}

TEST_P(EveryModel, RefusesAMirroredCamera) {
  std::mt19937 random(10);
  const RandomCamera camera(GetParam(), &random);
  if (FindCameraModel(GetParam())->param_names[1] == ',') return;  // one focal
  std::vector<double> params = camera.params();
  params[0] = -params[0];  // det J < 0 everywhere
  const Eigen::Vector2d pixel =
      ProjectRay(GetParam(), params.data(), {0.1, 0.1});
  EXPECT_EQ(Undistort(GetParam(), params, pixel).status,
            UndistortStatus::kNotConverged);
}

TEST(UndistortPixel, OfAPinholeIsExact) {
  const std::vector<double> params = {1024, 512, 320, 240};
  const Outcome outcome = Undistort(Pinhole::kId, params, {321.5, 100.25});
  ASSERT_EQ(outcome.status, UndistortStatus::kOk);
  EXPECT_EQ(outcome.observation.u, Eigen::Vector2d(1.5 / 1024, -139.75 / 512));
  EXPECT_EQ(outcome.observation.J,
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
    EXPECT_EQ(Undistort(SimpleRadial::kId, params_, {radius, 0}).status,
              UndistortStatus::kNotConverged);
  }
}

TEST_F(SimpleRadialFold, PixelsJustInsideItHaveOne) {
  const Eigen::Vector2d pixel(0.6 * (fold_px_ - 1e-3), 0.8 * (fold_px_ - 1e-3));
  const Outcome outcome = Undistort(SimpleRadial::kId, params_, pixel);
  ASSERT_EQ(outcome.status, UndistortStatus::kOk);
  EXPECT_LT(outcome.observation.u.norm(), 1 / std::sqrt(0.9));
}

TEST_F(SimpleRadialFold, AStartThatReproducesThePixelBeyondItIsNotTaken) {
  const Eigen::Vector2d beyond(1.5, 0);    // projects exactly, det J < 0
  const Eigen::Vector2d farther(-2.2, 0);  // x = 0.994, det J > 0 but not
                                           // all the way from the axis
  for (const Eigen::Vector2d& start : {beyond, farther}) {
    const Eigen::Vector2d pixel =
        ProjectRay(SimpleRadial::kId, params_.data(), start);
    const Outcome outcome = Undistort(SimpleRadial::kId, params_, pixel, start);
    if (pixel.norm() > fold_px_) {
      EXPECT_EQ(outcome.status, UndistortStatus::kNotConverged);
      continue;
    }
    ASSERT_EQ(outcome.status, UndistortStatus::kOk);
    EXPECT_LT(outcome.observation.u.norm(), 1 / std::sqrt(0.9));
    EXPECT_GT(outcome.observation.u.dot(pixel), 0);
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

TEST(UndistortPixel, FindsRaysUpToNinetyDegrees) {
  for (const WideCamera& camera : WideCameras()) {
    const Outcome outcome = Undistort(camera.model_id, camera.params,
                                      {0, camera.horizon_px - 0.01});
    EXPECT_EQ(outcome.status, UndistortStatus::kOk)
        << ModelName(camera.model_id);
    EXPECT_GT(outcome.observation.u.y(), 50) << ModelName(camera.model_id);
  }
}

TEST(UndistortPixel, TellsRaysPastNinetyDegreesFromFailures) {
  for (const WideCamera& camera : WideCameras()) {
    for (const std::optional<Eigen::Vector2d>& start :
         {std::optional<Eigen::Vector2d>(),
          std::optional<Eigen::Vector2d>({0, 3})}) {
      const Outcome outcome = Undistort(camera.model_id, camera.params,
                                        {0, camera.horizon_px + 0.01}, start);
      EXPECT_EQ(outcome.status, UndistortStatus::kOffAxis)
          << ModelName(camera.model_id);
    }
  }
}

TEST(UndistortPixel, OfAFisheyeThatFoldsBeforeNinetyDegreesFailsThere) {
  // theta - 0.3 theta^3 is largest at theta = 1.054: 702.7 px.
  const std::vector<double> params = {1000, 0, 0, -0.3};
  EXPECT_EQ(Undistort(SimpleRadialFisheye::kId, params, {702, 0}).status,
            UndistortStatus::kOk);
  EXPECT_EQ(Undistort(SimpleRadialFisheye::kId, params, {704, 0}).status,
            UndistortStatus::kNotConverged);
}

TEST(UndistortPixel, OfADivisionModelWithPositiveKEndsAtItsLastPixel) {
  const std::vector<double> params = {1000, 1000, 0, 0, 0.25};  // r = 1 / 0.5
  EXPECT_EQ(Undistort(Division::kId, params, {1990, 0}).status,
            UndistortStatus::kOk);
  EXPECT_EQ(Undistort(Division::kId, params, {2010, 0}).status,
            UndistortStatus::kNotConverged);
}

TEST(UndistortPixel, DoesNotCrossThePoleOfARationalDistortion) {
  // Denominator 1 - 4 s: |x| = r / (1 - 4 r^2) takes every value on either
  // side of r = 1/2, and only the inner side belongs to the pixel.
  const std::vector<double> params = {1000, 1000, 0, 0,  0, 0,
                                      0,    0,    0, -4, 0, 0};
  for (const Eigen::Vector2d& beyond :
       {Eigen::Vector2d(0.6, 0), Eigen::Vector2d(0, 2)}) {
    const Eigen::Vector2d pixel =
        ProjectRay(FullOpenCv::kId, params.data(), beyond);
    const Outcome outcome = Undistort(FullOpenCv::kId, params, pixel, beyond);
    ASSERT_EQ(outcome.status, UndistortStatus::kOk);
    EXPECT_LT(outcome.observation.u.norm(), 0.5);
  }
}

TEST(UndistortPixel, OfTheFovModelInvertsTheSmallOmegaPolynomial) {
  const std::vector<double> params = {1000, 1000, 0, 0, 5e-3};
  for (const double r : {0.0, 1e-6, 0.4, 3.0, 1e3}) {
    const Eigen::Vector2d pixel = ProjectRay(Fov::kId, params.data(), {r, 0});
    const Outcome outcome = Undistort(Fov::kId, params, pixel);
    ASSERT_EQ(outcome.status, UndistortStatus::kOk) << r;
    EXPECT_NEAR(outcome.observation.u.x(), r, 1e-12 * (1 + r));
  }
}

}  // namespace
}  // namespace krot::internal
