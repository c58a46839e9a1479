#include "krot/analysis/model_statistics.h"

#include <algorithm>
#include <array>
#include <limits>
#include <set>
#include <stdexcept>

#include <gtest/gtest.h>

#include "krot/camera/camera_model.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// Three images (the last without pose) by two cameras, and two points with
// tracks {image 11, image 12, image 13} and {image 11, image 12}.
Model ThreeCountedImages() {
  Model model;
  const int pinhole = FindCameraModel("SIMPLE_PINHOLE")->id;
  model.cameras = {{1, pinhole, 100, 80, {100, 50, 40}},
                   {2, pinhole, 100, 80, {100, 50, 40}}};
  model.images.resize(3);
  for (uint32_t n = 0; n < 3; ++n) {
    Image& image = model.images[n];
    image.id = 11 + n;
    image.name = "image" + std::to_string(11 + n);
    image.camera_id = n < 2 ? 1 : 2;
    image.points2D.push_back({0, 0, 21});
    image.points2D.push_back({0, 0, kInvalidPoint3DId});
    if (n < 2) image.points2D.push_back({0, 0, 22});
  }
  model.images[2].cam_from_world.translation.x() = kUnknown;
  UseTrivialRigs(&model);
  model.track_elements = {{11, 0}, {12, 0}, {13, 0}, {11, 2}, {12, 2}};
  model.points3D.resize(2);
  model.points3D[0].id = 21;
  model.points3D[0].track_end = 3;
  model.points3D[0].error = 0.5;
  model.points3D[1].id = 22;
  model.points3D[1].track_begin = 3;
  model.points3D[1].track_end = 5;
  return model;
}

const std::vector<double> kErrors = {1, 4, kUnknown, 4, 2};

TEST(ComputeColmapStatistics, CountsObservationsOfRegisteredImages) {
  const ColmapStatistics statistics =
      ComputeColmapStatistics(ThreeCountedImages());
  EXPECT_EQ(statistics.num_rigs, 0);
  EXPECT_EQ(statistics.num_frames, 0);
  EXPECT_EQ(statistics.num_cameras, 2);
  EXPECT_EQ(statistics.num_images, 3);
  EXPECT_EQ(statistics.num_registered_images, 2);
  EXPECT_EQ(statistics.num_points, 2);
  EXPECT_EQ(statistics.num_observations, 4);
  EXPECT_EQ(statistics.mean_track_length, 2);
  EXPECT_EQ(statistics.mean_observations_per_image, 2);
}

TEST(ComputeColmapStatistics, AveragesStoredErrorsThatAreSet) {
  Model model = ThreeCountedImages();
  EXPECT_EQ(ComputeColmapStatistics(model).mean_reprojection_error, 0.5);
  model.points3D[1].error = 1.5;
  EXPECT_EQ(ComputeColmapStatistics(model).mean_reprojection_error, 1);
  for (Point3D& point : model.points3D) point.error = -1;
  EXPECT_EQ(ComputeColmapStatistics(model).mean_reprojection_error, 0);
}

TEST(ComputeColmapStatistics, OfAnEmptyModelIsZero) {
  const ColmapStatistics statistics = ComputeColmapStatistics(Model());
  EXPECT_EQ(statistics.mean_track_length, 0);
  EXPECT_EQ(statistics.mean_observations_per_image, 0);
}

TEST(ErrorsByImage, ListsEveryImageInItsOrder) {
  const std::vector<ImageErrors> by_image =
      ErrorsByImage(ThreeCountedImages(), kErrors);
  ASSERT_EQ(by_image.size(), 3u);
  EXPECT_EQ(by_image[0].image_name, "image11");
  EXPECT_EQ(by_image[0].errors.max, 4);
  EXPECT_EQ(by_image[0].errors.mean, 2.5);
  EXPECT_EQ(by_image[1].errors.mean, 3);
  EXPECT_EQ(by_image[2].image_id, 13u);
  EXPECT_EQ(by_image[2].errors.count, 0);
  EXPECT_EQ(by_image[2].errors.not_finite, 1);
}

TEST(ErrorsByCamera, JoinsTheImagesOfEachCamera) {
  const std::vector<CameraErrors> by_camera =
      ErrorsByCamera(ThreeCountedImages(), kErrors);
  ASSERT_EQ(by_camera.size(), 2u);
  EXPECT_EQ(by_camera[0].camera_id, 1u);
  EXPECT_EQ(by_camera[0].num_images, 2);
  EXPECT_EQ(by_camera[0].errors.count, 4);
  EXPECT_EQ(by_camera[0].errors.mean, 2.75);
  EXPECT_EQ(by_camera[1].num_images, 1);
  EXPECT_EQ(by_camera[1].errors.not_finite, 1);
}

TEST(WorstObservations, AreSortedByErrorThenByTrack) {
  const std::vector<WorstObservation> worst =
      WorstObservations(ThreeCountedImages(), kErrors, 3);
  ASSERT_EQ(worst.size(), 3u);
  EXPECT_EQ(worst[0].image_name, "image12");
  EXPECT_EQ(worst[0].point3D_id, 21u);
  EXPECT_EQ(worst[0].point2D_idx, 0u);
  EXPECT_EQ(worst[0].error_px, 4);
  EXPECT_EQ(worst[1].image_id, 11u);
  EXPECT_EQ(worst[1].point3D_id, 22u);
  EXPECT_EQ(worst[1].point2D_idx, 2u);
  EXPECT_EQ(worst[2].error_px, 2);
}

TEST(WorstObservations, AreNoMoreThanThereAreErrors) {
  EXPECT_EQ(WorstObservations(ThreeCountedImages(), kErrors, 100).size(), 4u);
  EXPECT_TRUE(WorstObservations(ThreeCountedImages(), kErrors, 0).empty());
}

using Color = std::array<uint8_t, 3>;

constexpr double kNoError = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Three points with tracks of two, one and two observations.
Model ThreePoints() {
  Model model;
  model.track_elements.resize(5);
  model.points3D.resize(3);
  model.points3D[0].track_end = 2;
  model.points3D[1].track_begin = 2;
  model.points3D[1].track_end = 3;
  model.points3D[2].track_begin = 3;
  model.points3D[2].track_end = 5;
  return model;
}

TEST(ErrorColor, RunsFromBlueByGreenToRed) {
  const Color none = ErrorColor(0, 4);
  const Color middle = ErrorColor(1.6, 4);
  const Color top = ErrorColor(4, 4);
  EXPECT_GT(none[2], std::max(none[0], none[1]));
  EXPECT_GT(middle[1], std::max(middle[0], middle[2]));
  EXPECT_GT(top[0], std::max(top[1], top[2]));
}

TEST(ErrorColor, DependsOnTheShareOfTheTopAlone) {
  for (const double share : {0.0, 0.1, 0.33, 0.5, 0.9, 1.0}) {
    EXPECT_EQ(ErrorColor(share * 4, 4), ErrorColor(share * 8, 8)) << share;
  }
  EXPECT_EQ(ErrorColor(1000, 4), ErrorColor(4, 4));
}

TEST(ErrorColor, TellsHundredthsOfTheTopApart) {
  std::set<Color> colors;
  for (int i = 0; i <= 100; ++i) colors.insert(ErrorColor(i, 100));
  EXPECT_EQ(colors.size(), 101u);
}

TEST(ColorPointsByError, TakesTheLargestOfTheTrack) {
  Model model = ThreePoints();
  ColorPointsByError({1, 3, 2, 0.5, kNoError}, 4, &model);
  EXPECT_EQ(model.points3D[0].color, ErrorColor(3, 4));
  EXPECT_EQ(model.points3D[1].color, ErrorColor(2, 4));
  EXPECT_EQ(model.points3D[2].color, ErrorColor(0.5, 4));
}

TEST(ColorPointsByError, IsGreyWhereNoErrorIsFinite) {
  Model model = ThreePoints();
  ColorPointsByError({1, 3, 2, kInfinity, kNoError}, 4, &model);
  EXPECT_EQ(model.points3D[2].color, (Color{128, 128, 128}));
}

TEST(ColorPointsByError, ChangesNothingButColors) {
  SceneOptions options = SceneOf(4, 30, 3, 1);
  const Model scene = SynthesizeScene(options).model;
  Model model = scene;
  ColorPointsByError(PixelErrors(model), 4, &model);
  EXPECT_NE(model.points3D[0].color, scene.points3D[0].color);
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    model.points3D[k].color = scene.points3D[k].color;
  }
  EXPECT_THAT(model, IsModel(scene));
}

}  // namespace
}  // namespace krot::internal
