#include "krot/model.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/analysis/model_statistics.h"
#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

SceneOptions SmallScene() { return SceneOf(6, 100); }

// Two images one unit apart along x look along z at a point 10 away; camera
// f = 100, centre (50, 40).
Model TwoImages() {
  Model model;
  model.cameras = {
      {1, FindCameraModel("SIMPLE_PINHOLE")->id, 100, 80, {100, 50, 40}}};
  model.images.resize(2);
  for (uint32_t n = 0; n < 2; ++n) {
    model.images[n].id = n + 1;
    model.images[n].camera_id = 1;
    model.images[n].name = n == 0 ? "left" : "right";
  }
  model.images[1].cam_from_world.translation = {-1, 0, 0};
  UseTrivialRigs(&model);
  model.images[0].points2D = {{53, 44, 7}};  // projected to (50, 40): 5 px
  model.images[1].points2D = {{39, 40, 7}};  // projected to (40, 40): 1 px
  model.track_elements = {{1, 0}, {2, 0}};
  Point3D point;
  point.id = 7;
  point.xyz = {0, 0, 10};
  point.track_end = 2;
  model.points3D = {point};
  return model;
}

TEST(PixelErrors, AreDistancesInTheImage) {
  const std::vector<double> errors = PixelErrors(TwoImages());
  ASSERT_EQ(errors.size(), 2u);
  EXPECT_NEAR(errors[0], 5, 1e-13);
  EXPECT_NEAR(errors[1], 1, 1e-13);
}

TEST(PixelErrors, AreMeasuredInTheNormAskedFor) {
  EXPECT_NEAR(PixelErrors(TwoImages(), 1, Norm::L1())[0], 7, 1e-13);
  EXPECT_NEAR(PixelErrors(TwoImages(), 1, Norm::LInf())[0], 4, 1e-13);
}

TEST(PixelErrors, OfExactObservationsVanishWhateverTheCamera) {
  for (const CameraModelInfo& camera : CameraModels()) {
    SceneOptions options = SmallScene();
    options.camera_model_id = camera.id;
    options.sensors_per_rig = 2;
    const PixelErrorStatistics statistics =
        Summarize(PixelErrors(SynthesizeScene(options).ground_truth));
    EXPECT_LE(statistics.max, 1e-8) << camera.name;
    EXPECT_EQ(statistics.not_finite, 0) << camera.name;
  }
}

TEST(PixelErrors, AreNotNumbersBehindTheCamera) {
  Model model = TwoImages();
  model.points3D[0].xyz.z() = -10;
  EXPECT_TRUE(std::isnan(PixelErrors(model)[0]));
  model.points3D[0].xyz.z() = 0;
  EXPECT_TRUE(std::isnan(PixelErrors(model)[0]));
}

TEST(PixelErrors, AreNotNumbersWithoutAPose) {
  Model model = TwoImages();
  model.frames[1].rig_from_world.translation.y() = kNaN;
  const std::vector<double> errors = PixelErrors(model);
  EXPECT_FALSE(std::isnan(errors[0]));
  EXPECT_TRUE(std::isnan(errors[1]));
}

TEST(PixelErrors, OfAPanoramaGoTheShorterWayRound) {
  Model model = TwoImages();
  model.cameras[0].model_id = FindCameraModel("EQUIRECTANGULAR")->id;
  model.cameras[0].params = {100, 80};
  // Behind the camera: azimuth pi, elevation 0, the seam at x = 0 and x = 100.
  model.points3D[0].xyz = {0, 0, -10};
  Point2D& point2D = model.images[0].points2D[0];
  for (const double x : {3.0, 97.0}) {
    point2D.x = x;
    point2D.y = 40;
    EXPECT_NEAR(PixelErrors(model)[0], 3, 1e-12);
  }
}

TEST(PixelErrors, HaveTheSameBitsAtAnyNumberOfThreads) {
  SceneOptions options = SmallScene();
  options.num_points = 5000;
  options.pixel_noise = 1;
  const Model model = SynthesizeScene(options).model;
  const std::vector<double> errors = PixelErrors(model, 1);
  EXPECT_EQ(PixelErrors(model, 2), errors);
  EXPECT_EQ(PixelErrors(model, 7), errors);
}

TEST(Summarize, TakesTheNearestRankForThePercentile) {
  std::vector<double> errors;
  for (int n = 100; n >= 1; --n) errors.push_back(n);
  EXPECT_EQ(Summarize(errors).p99, 99);
  errors.push_back(101);
  EXPECT_EQ(Summarize(errors).p99, 100);  // ceil(0.99 * 101) = 100
  EXPECT_EQ(Summarize({5}).p99, 5);
}

TEST(Summarize, CountsWhatIsNotFiniteAndIgnoresIt) {
  const PixelErrorStatistics statistics = Summarize({3, kNaN, 4});
  EXPECT_EQ(statistics.count, 2);
  EXPECT_EQ(statistics.not_finite, 1);
  EXPECT_EQ(statistics.max, 4);
  EXPECT_DOUBLE_EQ(statistics.mean, 3.5);
  EXPECT_DOUBLE_EQ(statistics.rms, std::sqrt(12.5));
}

TEST(Summarize, OfNothingIsZero) {
  const PixelErrorStatistics statistics = Summarize({kNaN});
  EXPECT_EQ(statistics.count, 0);
  EXPECT_EQ(statistics.not_finite, 1);
  EXPECT_EQ(statistics.max, 0);
  EXPECT_EQ(statistics.p99, 0);
  EXPECT_EQ(statistics.mean, 0);
  EXPECT_EQ(statistics.rms, 0);
}

TEST(UpdatePointErrors, StoresTheMeanOfTheFiniteErrors) {
  Model model = TwoImages();
  UpdatePointErrors({5, 1}, &model);
  EXPECT_EQ(model.points3D[0].error, 3);
  UpdatePointErrors({5, kNaN}, &model);
  EXPECT_EQ(model.points3D[0].error, 5);
  UpdatePointErrors({kNaN, kNaN}, &model);
  EXPECT_EQ(model.points3D[0].error, -1);
}

TEST(UpdatePointErrors, RefusesErrorsOfAnotherModel) {
  Model model = TwoImages();
  EXPECT_THROW(UpdatePointErrors({1}, &model), std::invalid_argument);
}

// Images at x = 0, 1, 2 look along z; the last one may lose its pose.
Model ThreeImages() {
  Model model;
  model.cameras.resize(1);
  model.images.resize(3);
  for (uint32_t n = 0; n < 3; ++n) {
    model.images[n].id = n;
    model.images[n].cam_from_world.translation.x() = -static_cast<double>(n);
  }
  UseTrivialRigs(&model);
  return model;
}

void AddPoint(const Eigen::Vector3d& xyz, const std::vector<ImageId>& images,
              Model* model) {
  Point3D point;
  point.id = model->points3D.size();
  point.xyz = xyz;
  point.track_begin = model->track_elements.size();
  for (const ImageId image : images) {
    model->track_elements.push_back({image, 0});
  }
  point.track_end = model->track_elements.size();
  model->points3D.push_back(point);
}

void LosePose(Frame* frame) {
  frame->rig_from_world.translation.y() =
      std::numeric_limits<double>::quiet_NaN();
}

TEST(TrackLengthHistogram, CountsPointsByTheirTrackLength) {
  Model model = ThreeImages();
  AddPoint({0, 0, 1}, {0, 1}, &model);
  AddPoint({0, 0, 1}, {0, 1, 2}, &model);
  AddPoint({0, 0, 1}, {1, 2}, &model);
  EXPECT_THAT(TrackLengthHistogram(model), ElementsAre(Pair(2, 2), Pair(3, 1)));
}

TEST(ComputeDepthStatistics, CountsWhatIsNotInFront) {
  Model model = ThreeImages();
  AddPoint({0, 0, 4}, {0, 1}, &model);
  AddPoint({0, 0, -2}, {0}, &model);
  AddPoint({0, 0, 0}, {1}, &model);
  const DepthStatistics depths = ComputeDepthStatistics(model);
  EXPECT_EQ(depths.count, 4);
  EXPECT_EQ(depths.min, -2);
  EXPECT_EQ(depths.median, 0);  // of -2, 0, 4, 4
  EXPECT_EQ(depths.max, 4);
  EXPECT_EQ(depths.not_positive, 2);
}

TEST(ComputeDepthStatistics, IgnoresImagesWithoutPose) {
  Model model = ThreeImages();
  AddPoint({0, 0, 4}, {0, 2}, &model);
  LosePose(&model.frames[2]);
  EXPECT_EQ(ComputeDepthStatistics(model).count, 1);
  LosePose(&model.frames[0]);
  EXPECT_EQ(ComputeDepthStatistics(model).count, 0);
  EXPECT_EQ(ComputeDepthStatistics(model).max, 0);
}

TEST(TriangulationAnglesDeg, TakesEachPointsLargestAngle) {
  Model model = ThreeImages();
  AddPoint({1, 0, 1}, {0, 1, 2}, &model);  // 45, 45 and 90 degrees
  AddPoint({0, 0, 1}, {0, 1}, &model);     // 45 degrees
  AddPoint({0, 0, 1}, {1, 1}, &model);     // one image twice: 0
  AddPoint({0, 0, 1}, {1}, &model);        // none
  const ValueRange angles = TriangulationAnglesDeg(model);
  EXPECT_EQ(angles.count, 3);
  EXPECT_EQ(angles.min, 0);
  EXPECT_NEAR(angles.median, 45, 1e-12);
  EXPECT_NEAR(angles.max, 90, 1e-12);
}

TEST(TriangulationAnglesDeg, OfTinyAnglesKeepsItsDigits) {
  Model model = ThreeImages();
  AddPoint({0, 0, 1e9}, {0, 1}, &model);
  const ValueRange angles = TriangulationAnglesDeg(model);
  EXPECT_NEAR(angles.max * 0.017453292519943295 * 1e9, 1, 1e-12);
}

}  // namespace
}  // namespace krot::internal
