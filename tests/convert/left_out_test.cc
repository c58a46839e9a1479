#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/camera/camera_model.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/reprojection.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/problem/cost.h"
#include "krot/synthetic/scene.h"
#include "tests/convert/lens_model.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using ::testing::ElementsAre;

// Legacy, every point in all eight images of a distorting camera.
Model EightImages(const char* camera_model = "SIMPLE_RADIAL") {
  SceneOptions options = SceneOf(8, 50, 8);
  options.camera_model_id = FindCameraModel(camera_model)->id;
  options.has_rigs = false;
  return SynthesizeScene(options).model;
}

int64_t Count(const BuiltProblem& built, LeftOut reason) {
  return built.left_out[static_cast<size_t>(reason)];
}

int64_t CountOf(const Model& model, const Image& image) {
  int64_t count = 0;
  for (const TrackElement& element : model.track_elements) {
    count += element.image_id == image.id;
  }
  return count;
}

// The camera looks the other way: turned by 180 degrees about its y axis.
void TurnRound(Frame* frame) {
  Pose& pose = frame->rig_from_world;
  const Eigen::Quaterniond half_turn(0, 0, 1, 0);
  pose = {ToWxyz(half_turn * NormalizedQuaternion(pose.quaternion_wxyz)),
          half_turn * pose.translation};
}

// Nothing is lost: kept and left out add up.
void ExpectBooksBalance(const Model& model, const BuiltProblem& built) {
  int64_t sum = static_cast<int64_t>(built.problem.observations.size());
  for (const int64_t count : built.left_out) sum += count;
  EXPECT_EQ(sum, static_cast<int64_t>(model.track_elements.size()));
  EXPECT_LT(Cost(built.problem, built.start, Norm::L2(), 1),
            std::numeric_limits<double>::infinity());
}

// The 2D point of the first element of a point's track.
Point2D& FirstPoint2D(Model* model, size_t point) {
  const TrackElement& element =
      model->track_elements[model->points3D[point].track_begin];
  return model->images[element.image_id - 1].points2D[element.point2D_idx];
}

const Camera& FirstCamera(const Model& model, size_t point) {
  const TrackElement& element =
      model.track_elements[model.points3D[point].track_begin];
  return model.cameras[model.images[element.image_id - 1].camera_id - 1];
}

int64_t TrackLength(const Model& model, size_t point) {
  return static_cast<int64_t>(model.points3D[point].track_end -
                              model.points3D[point].track_begin);
}

TEST(LeftOutName, IsTheKeyOfTheReport) {
  std::vector<std::string> names;
  for (int r = 0; r < kNumLeftOutReasons; ++r) {
    names.push_back(LeftOutName(static_cast<LeftOut>(r)));
  }
  EXPECT_THAT(names, ElementsAre("behind", "undistortion", "short_track",
                                 "no_pose", "same_image", "fixed"));
}

TEST(LeftOut, NothingDependsOnTranslationsThatAreIgnored) {
  Model model = EightImages();
  const BuiltProblem expected = BuildProblem(model, {});
  model.frames[3].rig_from_world.translation.x() = std::nan("");
  for (Frame& frame : model.frames) frame.rig_from_world.translation *= -1;
  model.points3D[5].xyz.setConstant(std::nan(""));
  BuildProblemOptions options;
  options.ignore_translations = true;
  const BuiltProblem built = BuildProblem(model, options);
  EXPECT_THAT(built.left_out, ::testing::Each(0));
  EXPECT_EQ(built.num_retriangulated_points, 0);
  ASSERT_EQ(built.problem.observations.size(),
            expected.problem.observations.size());
  for (size_t i = 0; i < built.problem.observations.size(); ++i) {
    const Observation& a = built.problem.observations[i];
    const Observation& b = expected.problem.observations[i];
    EXPECT_EQ(a.view, b.view);
    EXPECT_LT((a.E - b.E).norm(), 1e-12 * b.E.norm());
  }
}

TEST(LeftOut, AnImageWithoutFiniteTranslationHasNoPose) {
  Model model = EightImages();
  const int64_t num_observations = CountOf(model, model.images[3]);
  ASSERT_GT(num_observations, 0);
  model.frames[3].rig_from_world.translation.x() = std::nan("");
  const BuiltProblem built = BuildProblem(model, {});
  EXPECT_EQ(Count(built, LeftOut::kNoPose), num_observations);
  EXPECT_THAT(built.frame_of, ElementsAre(0, 1, 2, 4, 5, 6, 7));
  ExpectBooksBalance(model, built);
}

// f (r + k r^3) with k < 0 never exceeds 2/3 f / sqrt(-3 k).
Model WithAPixelBeyondTheFold() {
  Model model = EightImages();
  Camera& camera = model.cameras[0];
  camera.params[3] = -0.1;
  FirstPoint2D(&model, 7).x =
      camera.params[1] + 2 * camera.params[0] / std::sqrt(0.3);
  return model;
}

TEST(LeftOut, APixelBeyondTheFoldOfItsPolynomialIsInWhereItsPointProjects) {
  const Model model = WithAPixelBeyondTheFold();
  const BuiltProblem built = BuildProblem(model, {});
  EXPECT_THAT(built.left_out, ::testing::Each(0));
  ExpectBooksBalance(model, built);
}

TEST(LeftOut, APixelBeyondTheFoldOfItsPolynomialHasNoRay) {
  const Model model = WithAPixelBeyondTheFold();
  BuildProblemOptions options;
  options.ignore_translations = true;
  const BuiltProblem built = BuildProblem(model, options);
  EXPECT_EQ(Count(built, LeftOut::kUndistortion), 1);
  EXPECT_EQ(built.problem.point_begin[8] - built.problem.point_begin[7],
            TrackLength(model, 7) - 1);
  ExpectBooksBalance(model, built);
}

TEST(LeftOut, AFisheyePixelBeyondTheHalfSphereIsIn) {
  Model model = EightImages("SIMPLE_FISHEYE");
  // theta = r / f.
  const Camera& camera = FirstCamera(model, 7);
  FirstPoint2D(&model, 7).x = camera.params[1] + 1.6 * camera.params[0];
  FirstPoint2D(&model, 7).y = camera.params[2];
  const BuiltProblem built = BuildProblem(model, {});
  EXPECT_THAT(built.left_out, ::testing::Each(0));
  ExpectBooksBalance(model, built);
  BuildProblemOptions options;
  options.ignore_translations = true;
  EXPECT_THAT(BuildProblem(model, options).left_out, ::testing::Each(0));
}

TEST(LeftOut, APointBehindItsCamerasIsRetriangulated) {
  Model model = EightImages();
  const Eigen::Vector3d truth = model.points3D[5].xyz;
  model.points3D[5].xyz *= -100;
  const BuiltProblem built = BuildProblem(model, {});
  EXPECT_EQ(built.num_retriangulated_points, 1);
  EXPECT_EQ(Count(built, LeftOut::kBehind), 0);
  EXPECT_NEAR((built.start.points[5] - truth).norm(), 0, 1e-9);
  ExpectBooksBalance(model, built);
}

TEST(LeftOut, OnlyAnObservationThatStaysBehindIsLeftOut) {
  Model model = EightImages();
  TurnRound(&model.frames[2]);

  const BuiltProblem built = BuildProblem(model, {});
  // Its rays still pass near the points, so some may be repaired by a point
  // behind all others; that would leave out more and is not done.
  EXPECT_EQ(Count(built, LeftOut::kBehind), CountOf(model, model.images[2]));
  EXPECT_EQ(built.num_retriangulated_points, 0);
  for (size_t k = 0; k < built.point_of.size(); ++k) {
    EXPECT_EQ(built.start.points[k], model.points3D[built.point_of[k]].xyz);
  }
  ExpectBooksBalance(model, built);
}

TEST(LeftOut, WhatRemainsOfATrackMayBeTooShort) {
  Model model = EightImages();
  const BuiltProblem all = BuildProblem(model, {/*min_track_length=*/8, 1});
  int64_t num_short = 0;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    if (TrackLength(model, k) < 8) num_short += TrackLength(model, k);
  }
  EXPECT_EQ(Count(all, LeftOut::kShortTrack), num_short);

  model.frames[3].rig_from_world.translation.x() = std::nan("");
  const BuiltProblem none = BuildProblem(model, {/*min_track_length=*/8, 1});
  EXPECT_EQ(none.problem.num_points, 0);
  EXPECT_EQ(none.problem.num_frames, 0);
  EXPECT_TRUE(none.problem.views.empty());
  EXPECT_TRUE(none.problem.observations.empty());
  EXPECT_GT(Count(none, LeftOut::kNoPose), 0);
  ExpectBooksBalance(model, none);
}

TEST(LeftOut, AnImageOfNoFrameHasNoPose) {
  SceneOptions options = SceneOf(6, 50);
  options.sensors_per_rig = 2;
  Model model = SynthesizeScene(options).model;
  const ImageId lost = static_cast<ImageId>(model.frames[1].data[0].data_id);
  model.frames[1].data.erase(model.frames[1].data.begin());
  int64_t num_observations = 0;
  for (const TrackElement& element : model.track_elements) {
    num_observations += element.image_id == lost;
  }
  const BuiltProblem built = BuildProblem(model, {});
  EXPECT_EQ(Count(built, LeftOut::kNoPose), num_observations);
  ExpectBooksBalance(model, built);
}

TEST(LeftOut, APanoramaSeesWhatIsBehindIt) {
  Model model = EightImages();
  model.cameras.push_back(model.cameras[0]);
  Camera& panorama = model.cameras.back();
  panorama.id = static_cast<CameraId>(model.cameras.size());
  panorama.model_id = FindCameraModel("EQUIRECTANGULAR")->id;
  panorama.params = {1024, 512};
  TurnRound(&model.frames[4]);
  const int64_t num_observations = CountOf(model, model.images[4]);
  EXPECT_EQ(Count(BuildProblem(model, {}), LeftOut::kBehind), num_observations);
  model.images[4].camera_id = panorama.id;
  const BuiltProblem built = BuildProblem(model, {});
  EXPECT_THAT(built.left_out, ::testing::Each(0));
  EXPECT_EQ(built.num_retriangulated_points, 0);
  ExpectBooksBalance(model, built);
}

// A fifth of the observations have a twin in their image.
SyntheticScene SceneWithTwins() {
  SceneOptions options = SceneOf(6, 50, 4);
  options.duplicate_ratio = 0.2;
  return SynthesizeScene(options);
}

BuiltProblem Build(const Model& model, SameImage same_image) {
  BuildProblemOptions options;
  options.same_image = same_image;
  return BuildProblem(model, options);
}

TEST(SameImage, OfTwinsTheOneClosestToTheReprojectionStays) {
  const Model& truth = SceneWithTwins().ground_truth;
  const BuiltProblem all = Build(truth, SameImage::kKeep);
  const BuiltProblem closest = Build(truth, SameImage::kClosest);
  EXPECT_GT(all.num_same_image_tracks, 0);
  EXPECT_EQ(closest.num_same_image_tracks, all.num_same_image_tracks);
  const auto left_out =
      closest.left_out[static_cast<size_t>(LeftOut::kSameImage)];
  EXPECT_EQ(closest.pixels.size() + static_cast<size_t>(left_out),
            all.pixels.size());
  // Observations without noise have no error, and their twins have one.
  const Reprojection reprojection(truth, closest);
  for (size_t i = 0; i < closest.pixels.size(); ++i) {
    EXPECT_LT(
        reprojection.Error(closest.start, Norm::L2(), static_cast<int64_t>(i)),
        1e-6);
  }
  for (int32_t k = 0; k < closest.problem.num_points; ++k) {
    const int64_t begin = closest.problem.point_begin[k];
    EXPECT_FALSE(HasImageTwice(
        &closest.problem.observations[begin],
        static_cast<int>(closest.problem.point_begin[k + 1] - begin)));
  }
}

TEST(SameImage, KeepsAllByDefault) {
  const SyntheticScene scene = SceneWithTwins();
  EXPECT_EQ(BuildProblem(scene.model, {}).pixels.size(),
            scene.model.track_elements.size());
}

// Point 0 is seen by image 0 alone, so that it takes no part.
Model ModelWithAShortTrack() {
  Model model = MakeLensModel({});
  const uint64_t num_images = model.images.size();
  for (uint64_t e = 1; e < num_images; ++e) {
    model.images[e].points2D[0].point3D_id = kInvalidPoint3DId;
  }
  model.track_elements.erase(model.track_elements.begin() + 1,
                             model.track_elements.begin() + num_images);
  model.points3D[0].track_end = 1;
  for (size_t k = 1; k < model.points3D.size(); ++k) {
    model.points3D[k].track_begin -= num_images - 1;
    model.points3D[k].track_end -= num_images - 1;
  }
  return model;
}

TEST(CarryLeftOutPoints, KeepsTheErrorOfAPointWhoseOnlyImageHasMoved) {
  const Model before = ModelWithAShortTrack();
  const BuiltProblem built = BuildProblem(before, {});
  ASSERT_EQ(built.problem.num_points,
            static_cast<int>(before.points3D.size()) - 1);
  const std::vector<double> errors_px = PixelErrors(before);
  Model moved = before;
  moved.frames[0].rig_from_world.translation += Eigen::Vector3d(0.3, 0.1, 0);
  ASSERT_GT(PixelErrors(moved)[0], errors_px[0] + 10);

  Model after = moved;
  CarryLeftOutPoints(before, errors_px, Norm::L2(), built, {},
                     /*level=*/1e-3, &after);
  EXPECT_NEAR(PixelErrors(after)[0], errors_px[0], 1e-9);
  for (size_t k = 1; k < after.points3D.size(); ++k) {
    EXPECT_EQ(after.points3D[k].xyz, before.points3D[k].xyz);
  }
}

TEST(CarryLeftOutPoints, LeavesAPointWhoseErrorIsBelowTheLevel) {
  const Model before = ModelWithAShortTrack();
  Model after = before;
  after.images[0].cam_from_world.translation += Eigen::Vector3d(0.3, 0.1, 0);
  CarryLeftOutPoints(before, PixelErrors(before), Norm::L2(),
                     BuildProblem(before, {}), {},
                     /*level=*/1e4, &after);
  EXPECT_EQ(after.points3D[0].xyz, before.points3D[0].xyz);
}

}  // namespace
}  // namespace krot::internal
