#include "krot/synthetic/scene.h"

#include <gtest/gtest.h>

#include "krot/camera/camera_model.h"

namespace krot::internal {
namespace {

class DefaultCameraOfModel : public testing::TestWithParam<int> {};

TEST_P(DefaultCameraOfModel, HasTheParametersOfItsModel) {
  const Camera camera = DefaultCamera(GetParam(), 1024, 768, 1000);
  EXPECT_EQ(camera.model_id, GetParam());
  EXPECT_EQ(static_cast<int>(camera.params.size()),
            FindCameraModel(GetParam())->num_params);
}

TEST_P(DefaultCameraOfModel, ProjectsTheAxisToTheMiddleOfTheImage) {
  const Camera camera = DefaultCamera(GetParam(), 1024, 768, 1000);
  const Eigen::Vector2d pixel = ProjectRay(camera, Eigen::Vector2d::Zero());
  EXPECT_EQ(pixel, Eigen::Vector2d(512, 384));
}

TEST_P(DefaultCameraOfModel, HasOneRayForEveryPixelAtTheWidestAngle) {
  const Camera camera = DefaultCamera(GetParam(), 1024, 1024, 512);
  for (int x = 0; x <= 1024; x += 64) {
    for (int y = 0; y <= 1024; y += 64) {
      const Eigen::Vector2d pixel(x, y);
      ASSERT_TRUE(UndistortPixel(camera, pixel)) << pixel.transpose();
    }
  }
}

// Distortions are there to be noticed: a scene with a distorting camera must
// not be solvable as one with a pinhole camera.
TEST_P(DefaultCameraOfModel, DistortsByPixelsIfTheModelCanDistort) {
  const Camera camera = DefaultCamera(GetParam(), 1024, 768, 1000);
  const bool is_pinhole = GetParam() <= 1;
  const Eigen::Vector2d u(0.5, 0.35);
  const bool two_focal_lengths = camera.params[1] != 512;
  const Eigen::Vector2d pinhole_px(
      1000 * u.x() + 512, (two_focal_lengths ? 1010 : 1000) * u.y() + 384);
  const double distortion_px = (ProjectRay(camera, u) - pinhole_px).norm();
  if (is_pinhole) {
    EXPECT_LT(distortion_px, 1e-9);
  } else {
    EXPECT_GT(distortion_px, 1);
    EXPECT_LT(distortion_px, 100);
  }
}

INSTANTIATE_TEST_SUITE_P(All, DefaultCameraOfModel, testing::Range(0, 17));

TEST(DefaultCamera, OfAPanoramaFillsItsImage) {
  const Camera camera = DefaultCamera(17, 1024, 768, 1000);
  EXPECT_EQ(camera.params, (std::vector<double>{1024, 768}));
}

TEST(DefaultCamera, OfAnUnknownModelIsRefused) {
  EXPECT_THROW(DefaultCamera(18, 1024, 768, 1000), std::invalid_argument);
  EXPECT_THROW(DefaultCamera(-1, 1024, 768, 1000), std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
