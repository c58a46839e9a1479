#include "krot/analysis/model_statistics.h"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "krot/camera/camera_model.h"
#include "krot/model/rigs.h"

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

}  // namespace
}  // namespace krot::internal
