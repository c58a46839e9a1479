#include "krot/analysis/model_statistics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

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
