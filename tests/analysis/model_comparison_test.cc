#include "krot/analysis/model_comparison.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/base/numbers.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

SceneOptions NoisyScene() {
  SceneOptions options = SceneOf(7, 80, 6, 0.5);
  options.has_rigs = false;
  return options;
}

Model SomeModel() { return SynthesizeScene(NoisyScene()).model; }

std::optional<ComparisonSummary> Compare(const Model& model1,
                                         const Model& model2,
                                         AlignmentKind alignment) {
  CompareModelsOptions options;
  options.alignment = alignment;
  return CompareModels(model1, model2, FindCorrespondence(model1, model2),
                       options);
}

// With other ids and the records in reverse.
Model Renamed(const Model& model) {
  Model result = model;
  for (Image& image : result.images) {
    image.id += 1000;
    for (Point2D& point2D : image.points2D) {
      if (point2D.point3D_id != kInvalidPoint3DId) point2D.point3D_id += 500;
    }
  }
  for (TrackElement& element : result.track_elements) element.image_id += 1000;
  for (Point3D& point : result.points3D) point.id += 500;
  std::reverse(result.images.begin(), result.images.end());
  UseTrivialRigs(&result);
  return result;
}

TEST(FindCorrespondence, MatchesImagesByNameAndPointsByTheirObservations) {
  const Model model = SomeModel();
  const Model renamed = Renamed(model);
  const ModelCorrespondence found = FindCorrespondence(model, renamed);
  ASSERT_EQ(found.images.size(), model.images.size());
  for (const IndexPair& pair : found.images) {
    EXPECT_EQ(model.images[pair.first].name, renamed.images[pair.second].name);
  }
  EXPECT_EQ(found.observations.size(), model.track_elements.size());
  ASSERT_EQ(found.points.size(), model.points3D.size());
  for (const IndexPair& pair : found.points) {
    EXPECT_EQ(model.points3D[pair.first].id + 500,
              renamed.points3D[pair.second].id);
  }
}

TEST(FindCorrespondence, SharesNothingWithOtherNamesOrOtherPixels) {
  const Model model = SomeModel();
  Model other_names = model;
  for (Image& image : other_names.images) image.name += ".png";
  EXPECT_TRUE(FindCorrespondence(model, other_names).images.empty());

  Model other_pixels = model;
  for (Image& image : other_pixels.images) {
    for (Point2D& point2D : image.points2D) point2D.x += 1;
  }
  const ModelCorrespondence found = FindCorrespondence(model, other_pixels);
  EXPECT_EQ(found.images.size(), model.images.size());
  EXPECT_TRUE(found.observations.empty());
  EXPECT_TRUE(found.points.empty());
}

TEST(FindCorrespondence, GivesAPointThatWasSplitToItsLargerPart) {
  // One point with a track of three in model 1; in model 2 its first
  // observation belongs to a point of its own that bears its old id.
  Model whole;
  whole.cameras = {{1, 0, 100, 100, {100, 50, 50}}};
  for (const ImageId id : {1, 2, 3}) {
    Image image;
    image.id = id;
    image.camera_id = 1;
    image.name = std::to_string(id);
    image.points2D = {{10, 10, 7}};
    whole.images.push_back(image);
  }
  whole.track_elements = {{1, 0}, {2, 0}, {3, 0}};
  whole.points3D.resize(1);
  whole.points3D[0].id = 7;
  whole.points3D[0].track_end = 3;
  Model split = whole;
  split.images[1].points2D[0].point3D_id = 8;
  split.images[2].points2D[0].point3D_id = 8;
  split.points3D.resize(2);
  split.points3D[0].track_end = 1;
  split.points3D[1].id = 8;
  split.points3D[1].track_begin = 1;
  split.points3D[1].track_end = 3;

  const ModelCorrespondence found = FindCorrespondence(whole, split);
  EXPECT_EQ(found.observations.size(), 3u);
  ASSERT_EQ(found.points.size(), 1u);
  EXPECT_EQ(found.points[0].second, 1);
}

TEST(CompareModels, FindsNoDifferenceBetweenAModelAndItself) {
  const Model model = SomeModel();
  for (const AlignmentKind kind : {AlignmentKind::kNone, AlignmentKind::kFrame,
                                   AlignmentKind::kSimilarity}) {
    const std::optional<ComparisonSummary> summary =
        Compare(model, Renamed(model), kind);
    ASSERT_TRUE(summary);
    EXPECT_EQ(summary->rotation_deg.max, 0);
    EXPECT_EQ(summary->center.max, 0);
    EXPECT_EQ(summary->point.max, 0);
    EXPECT_EQ(summary->center.count, 7);
    EXPECT_EQ(summary->point.count, 80);
    EXPECT_EQ(summary->errors1.max, summary->errors2.max);
    EXPECT_EQ(summary->shared_errors1.rms, summary->shared_errors2.rms);
  }
}

TEST(CompareModels, SeesNoDifferenceBehindASimilarity) {
  const Model model = SomeModel();
  const Similarity similarity{
      0.3, Eigen::AngleAxisd(2, Vector3d::UnitZ()).matrix(), Vector3d(1, 2, 3)};
  const Model moved = TransformModel(model, similarity);
  for (const AlignmentKind kind :
       {AlignmentKind::kFrame, AlignmentKind::kSimilarity}) {
    const ComparisonSummary summary = Compare(model, moved, kind).value();
    EXPECT_LE(summary.rotation_deg.max, 1e-9);
    EXPECT_LE(summary.center.max, 1e-9);
    EXPECT_LE(summary.point.max, 1e-9);
  }
  const ComparisonSummary as_stored =
      Compare(model, moved, AlignmentKind::kNone).value();
  EXPECT_NEAR(as_stored.rotation_deg.max, 360 / kPi, 1e-9);
  EXPECT_NEAR(as_stored.rotation_deg.median, 360 / kPi, 1e-9);
}

TEST(CompareModels, SaysHowFarTheCamerasMovedAndNotTheOrigin) {
  const Model model = SomeModel();
  const Similarity far = {
      1, Eigen::AngleAxisd(1e-7, Vector3d::UnitZ()).toRotationMatrix(),
      Vector3d::Zero()};
  const Similarity away = {1, Eigen::Matrix3d::Identity(),
                           Vector3d(2e6, -4e6, 4e6)};
  // A turn of 1e-7 about an origin that is 6e6 away moves everything by 0.6.
  const Model model1 = TransformModel(model, away);
  const Model model2 = TransformModel(TransformModel(model, far), away);
  const ComparisonSummary summary =
      *Compare(model1, model2, AlignmentKind::kFrame);
  EXPECT_GT(summary.world1_from_world2.translation.norm(), 0.1);
  EXPECT_LT(summary.moved, 1e-6);
  EXPECT_NEAR(Compare(model, model1, AlignmentKind::kFrame)->moved, 6e6, 1e-3);
}

TEST(CompareModels, IsNotMisledByACameraThatRanAway) {
  const Model model = SomeModel();
  Model run = model;
  run.images[3].cam_from_world.translation *= 1e6;
  UseTrivialRigs(&run);
  const ComparisonSummary summary = *Compare(model, run, AlignmentKind::kFrame);
  EXPECT_LT(summary.center.median, 1e-12);
  EXPECT_LT(summary.point.max, 1e-12);
  EXPECT_GT(summary.center.max, 1e5);
  EXPECT_LT(summary.scene_radius, 2);
}

TEST(CompareModels, ReportsThePointAndTheCameraThatMoved) {
  const Model model = SomeModel();
  Model moved = model;
  moved.points3D[5].xyz += Vector3d(0, 0.03, 0.04);
  const Vector3d shift(0.3, 0, 0.4);
  Pose& pose = moved.frames[2].rig_from_world;
  pose.translation -= pose.Rotation() * shift;
  const ComparisonSummary summary =
      Compare(model, moved, AlignmentKind::kNone).value();
  EXPECT_NEAR(summary.point.max, 0.05, 1e-14);
  EXPECT_NEAR(summary.point.mean, 0.05 / 80, 1e-14);
  EXPECT_EQ(summary.point.median, 0);
  ASSERT_EQ(summary.worst_points.size(), 10u);
  EXPECT_EQ(summary.worst_points[0].point3D_id1, model.points3D[5].id);
  EXPECT_EQ(summary.worst_points[1].distance, 0);
  for (size_t n = 0; n < summary.images.size(); ++n) {
    EXPECT_NEAR(summary.images[n].pose.value().center, n == 2 ? 0.5 : 0.0,
                1e-14);
  }
  EXPECT_NEAR(summary.center.rms, 0.5 / std::sqrt(7.0), 1e-14);
  EXPECT_GT(summary.images[2].errors2.max, summary.images[2].errors1.max);
}

TEST(CompareModels, LeavesOutWhatOnlyOneModelHas) {
  const Model model = SomeModel();
  Model smaller = model;
  smaller.images[0].name = "another";
  smaller.frames[1].rig_from_world.translation.setConstant(
      std::numeric_limits<double>::quiet_NaN());
  const ComparisonSummary summary =
      Compare(model, smaller, AlignmentKind::kFrame).value();
  EXPECT_EQ(summary.shared.num_images, 6);
  EXPECT_EQ(summary.num_shared_poses, 5);
  EXPECT_EQ(summary.center.count, 5);
  EXPECT_FALSE(summary.images[0].pose);
  EXPECT_EQ(summary.errors1.not_finite, 0);
  EXPECT_EQ(summary.errors2.not_finite,
            static_cast<int64_t>(std::count_if(
                model.track_elements.begin(), model.track_elements.end(),
                [&](const TrackElement& element) {
                  return element.image_id == model.images[1].id;
                })));
}

TEST(CompareModels, ComparesErrorsOfModelsWithoutPosesAsStoredOnly) {
  const Model model = SomeModel();
  Model without_poses = model;
  for (Frame& frame : without_poses.frames) {
    frame.rig_from_world.translation.setConstant(
        std::numeric_limits<double>::infinity());
  }
  EXPECT_FALSE(Compare(model, without_poses, AlignmentKind::kFrame));
  EXPECT_FALSE(Compare(model, without_poses, AlignmentKind::kSimilarity));
  const std::optional<ComparisonSummary> summary =
      Compare(model, without_poses, AlignmentKind::kNone);
  ASSERT_TRUE(summary);
  EXPECT_EQ(summary->center.count, 0);
  EXPECT_EQ(summary->scene_radius, 0);
  EXPECT_EQ(summary->errors2.count, 0);
}

TEST(CompareModels, AsksForACountThatIsNotNegative) {
  const Model model = SomeModel();
  CompareModelsOptions options;
  options.num_worst = -1;
  EXPECT_THROW(
      CompareModels(model, model, FindCorrespondence(model, model), options),
      std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
