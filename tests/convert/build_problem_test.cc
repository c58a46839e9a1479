#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <vector>

#include "krot/camera/camera_model.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/reprojection.h"
#include "krot/model.h"
#include "krot/problem/cost.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

SceneOptions SmallScene() {
  SceneOptions options = SceneOf(8, 100, 6, 1);
  options.camera_model_id = FindCameraModel("PINHOLE")->id;
  return options;
}

SceneOptions RigScene() {
  SceneOptions options = SmallScene();
  options.sensors_per_rig = 3;
  options.rig_baseline = 0.1;
  return options;
}

double L2Cost(const BuiltProblem& built) {
  return Cost(built.problem, built.start, Norm::L2(), 1);
}

TEST(BuildProblem, PricesAModelByItsTruePixelErrorsWhateverTheCamera) {
  for (const CameraModelInfo& camera : CameraModels()) {
    SceneOptions options = RigScene();
    options.camera_model_id = camera.id;
    if (!camera.has_image_plane) continue;
    const Model model = SynthesizeScene(options).model;
    const BuiltProblem built = BuildProblem(model, {});
    EXPECT_EQ(built.problem.observations.size(), model.track_elements.size());
    const double largest = Summarize(PixelErrors(model)).max;
    EXPECT_NEAR(L2Cost(built), largest, 1e-9) << camera.name;
    EXPECT_NEAR(Reprojection(model, built).TrueCost(built.start, Norm::L2(), 1),
                largest, 1e-9)
        << camera.name;
  }
}

TEST(BuildProblem, OfExactObservationsCostsNothingWhateverTheCamera) {
  for (const CameraModelInfo& camera : CameraModels()) {
    if (!camera.has_image_plane) continue;
    SceneOptions options = RigScene();
    options.camera_model_id = camera.id;
    options.pixel_noise = 0;
    const Model model = SynthesizeScene(options).model;
    const BuiltProblem built = BuildProblem(model, {});
    EXPECT_EQ(built.problem.observations.size(), model.track_elements.size())
        << camera.name;
    EXPECT_LE(L2Cost(built), 1e-8) << camera.name;
  }
}

TEST(BuildProblem, MakesOneUnknownPerFrameAndOneViewPerImage) {
  const Model model = SynthesizeScene(RigScene()).model;
  const BuiltProblem built = BuildProblem(model, {});
  EXPECT_EQ(built.problem.num_frames, static_cast<int>(model.frames.size()));
  EXPECT_EQ(built.problem.views.size(), model.images.size());
  EXPECT_EQ(built.problem.num_points, static_cast<int>(model.points3D.size()));
  EXPECT_EQ(built.start.translations.size(), built.frame_of.size());
  EXPECT_EQ(built.start.points.size(), built.point_of.size());
}

TEST(BuildProblem, OfALegacyModelIsThatOfItsTrivialRigs) {
  SceneOptions options = SmallScene();
  const BuiltProblem with_rigs =
      BuildProblem(SynthesizeScene(options).model, {});
  options.has_rigs = false;
  const BuiltProblem legacy = BuildProblem(SynthesizeScene(options).model, {});
  EXPECT_EQ(L2Cost(legacy), L2Cost(with_rigs));
  EXPECT_EQ(legacy.start.translations, with_rigs.start.translations);
  EXPECT_EQ(legacy.frame_of, with_rigs.frame_of);
}

TEST(BuildProblem, TakesPosesFromFramesAndNotFromImages) {
  Model model = SynthesizeScene(RigScene()).model;
  const double cost = L2Cost(BuildProblem(model, {}));
  for (Image& image : model.images) image.cam_from_world = Pose();
  EXPECT_EQ(L2Cost(BuildProblem(model, {})), cost);
}

TEST(BuildProblem, SaysWhereEachObservationCameFrom) {
  SceneOptions options = RigScene();
  options.camera_model_id = FindCameraModel("OPENCV")->id;
  Model model = SynthesizeScene(options).model;
  // Something is missing, so that indices differ between problem and model.
  model.frames[2].rig_from_world.translation.setConstant(std::nan(""));
  const BuiltProblem built = BuildProblem(model, {});
  ASSERT_LT(built.problem.observations.size(), model.track_elements.size());
  ASSERT_LT(built.frame_of.size(), model.frames.size());

  for (size_t i = 0; i < built.problem.observations.size(); ++i) {
    const Observation& observation = built.problem.observations[i];
    const Image& image = model.images[built.image_of[observation.view]];
    const Point2D& point2D = image.points2D[built.point2D_of[i]];
    const Point3D& point3D = model.points3D[built.point_of[observation.point]];
    EXPECT_EQ(point2D.point3D_id, point3D.id);
    EXPECT_EQ(built.start.points[observation.point], point3D.xyz);
    const Frame& frame =
        model.frames
            [built.frame_of[built.problem.views[observation.view].frame]];
    EXPECT_EQ(
        built.start.translations[built.problem.views[observation.view].frame],
        frame.rig_from_world.translation);

    const Camera& camera = model.cameras[image.camera_id - 1];
    ASSERT_EQ(camera.id, image.camera_id);
    const Eigen::Vector2d pixel(point2D.x, point2D.y);
    EXPECT_EQ(built.pixels[i], pixel);
    const Eigen::Vector3d x_cam =
        Reprojection(model, built).InCamera(built.start, i);
    const auto row = RowAtProjection(camera, pixel, x_cam);
    ASSERT_TRUE(row);
    EXPECT_NEAR((observation.E - *row).norm(), 0, 1e-9 * row->norm());
  }
}

TEST(BuildProblem, KeepsBothOfTwoObservationsByOneImage) {
  SceneOptions options = SmallScene();
  options.duplicate_ratio = 0.5;
  const Model model = SynthesizeScene(options).model;
  const BuiltProblem built = BuildProblem(model, {});
  EXPECT_EQ(built.problem.observations.size(), model.track_elements.size());
}

TEST(BuildProblem, KeepsAPointSeenByOneImageTwiceAndByNoOther) {
  Model model = SynthesizeScene(SmallScene()).model;
  // A new point in front of image 0, observed at its pixels 0 and 1.
  Image& image = model.images[0];
  Point3D point;
  point.id = 1000000;
  point.xyz = image.cam_from_world.Rotation().transpose() *
              (Eigen::Vector3d(0, 0, 1) - image.cam_from_world.translation);
  point.track_begin = model.track_elements.size();
  for (int twin = 0; twin < 2; ++twin) {
    model.track_elements.push_back(
        {image.id, static_cast<uint32_t>(image.points2D.size())});
    image.points2D.push_back({500.0 + twin, 400, point.id});
  }
  point.track_end = model.track_elements.size();
  model.points3D.push_back(point);

  const BuiltProblem built = BuildProblem(model, {});
  EXPECT_EQ(built.problem.observations.size(), model.track_elements.size());
  EXPECT_EQ(built.point_of.back(), static_cast<int>(model.points3D.size()) - 1);
}

TEST(BuildProblem, RefusesATrackLengthBelowOne) {
  EXPECT_THROW(BuildProblem(SynthesizeScene(SmallScene()).model, {0, 1}),
               std::invalid_argument);
}

}  // namespace
}  // namespace krot::internal
