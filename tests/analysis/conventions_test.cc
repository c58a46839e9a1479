#include <cmath>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/check.h"
#include "krot/model.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Model SceneOfColmap(int seed, double outlier_ratio = 0) {
  SceneOptions options = SceneOf(12, 200, 4, 0.5, seed);
  options.outlier_ratio = outlier_ratio;
  return SynthesizeScene(options).model;
}

// A program whose camera axes point along these of COLMAP's.
Matrix3d Axes(const Vector3d& x, const Vector3d& y, const Vector3d& z) {
  Matrix3d axes;
  axes << x, y, z;
  return axes;
}
const Vector3d kRight = Vector3d::UnitX();
const Vector3d kDown = Vector3d::UnitY();
const Vector3d kForward = Vector3d::UnitZ();

// How a program writes poses.
struct Program {
  const char* name;
  Matrix3d axes;
  bool writes_camera_to_world, writes_centers, writes_w_last;
};

Pose Written(const Program& program, const Pose& pose,
             const Matrix3d& world_from_file) {
  Matrix3d rotation =
      program.axes.transpose() * pose.Rotation() * world_from_file;
  Vector3d translation = program.axes.transpose() * pose.translation;
  if (program.writes_centers) translation = -rotation.transpose() * translation;
  if (program.writes_camera_to_world) rotation.transposeInPlace();
  Pose written = ToPose({rotation, translation});
  if (program.writes_w_last) {
    const auto [w, x, y, z] = written.quaternion_wxyz;
    written.quaternion_wxyz = {x, y, z, w};
  }
  return written;
}

// The model in that program's numbers. In a left-handed one the world's y is
// turned round, too.
Model WrittenBy(const Program& program, Model model) {
  const Matrix3d world_from_file =
      program.axes.determinant() < 0 ? Matrix3d(Vector3d(1, -1, 1).asDiagonal())
                                     : Matrix3d(Matrix3d::Identity());
  for (Point3D& point : model.points3D) point.xyz = world_from_file * point.xyz;
  for (Frame& frame : model.frames) {
    Pose& pose = frame.rig_from_world;
    pose = Written(program, pose, world_from_file);
  }
  return model;
}

std::vector<Program> Programs() {
  return {
      {"inverse poses", Axes(kRight, kDown, kForward), true, true, false},
      {"inverse rotations", Axes(kRight, kDown, kForward), true, false, false},
      {"centres", Axes(kRight, kDown, kForward), false, true, false},
      {"w last", Axes(kRight, kDown, kForward), false, false, true},
      {"OpenGL", Axes(kRight, -kDown, -kForward), true, true, false},
      {"OpenGL, w last", Axes(kRight, -kDown, -kForward), true, true, true},
      {"a robot's", Axes(kForward, -kRight, -kDown), true, true, true},
      {"Unity", Axes(kRight, -kDown, kForward), true, true, true},
      {"Unreal", Axes(kForward, kRight, -kDown), true, true, true},
  };
}

TEST(FindConventions, FindsNoneInModelsOfColmap) {
  for (int seed = 1; seed <= 5; ++seed) {
    EXPECT_FALSE(FindConventions(SceneOfColmap(seed)));
    EXPECT_FALSE(FindConventions(SceneOfColmap(seed, /*outlier_ratio=*/0.3)));
  }
}

TEST(FindConventions, FindsNoneWherePosesAreWrongInDifferentWays) {
  for (int seed = 1; seed <= 3; ++seed) {
    Model model = SceneOfColmap(seed);
    std::srand(seed);
    for (Frame& frame : model.frames) {
      frame.rig_from_world.quaternion_wxyz =
          ToWxyz(Eigen::Quaterniond::UnitRandom());
    }
    EXPECT_FALSE(FindConventions(model));
  }
}

// The same for the sensors of rigs: the rig has the cameras' axes, as a rig has
// those of its reference sensor.
Model SensorsWrittenBy(const Program& program, Model model) {
  for (RigSensor& sensor : model.rigs[0].sensors) {
    Pose& pose = *sensor.sensor_from_rig;
    pose = Written(program, pose, program.axes);
  }
  return model;
}

Model RigSceneOfColmap(double outlier_ratio = 0) {
  SceneOptions options = SceneOf(20, 1000, 8, 0.5, 7);
  options.sensors_per_rig = 4;
  options.rig_rotation_deg = 17;
  options.rig_baseline = 0.1;
  options.outlier_ratio = outlier_ratio;
  return SynthesizeScene(options).model;
}

// What the conversion must give back: rays and points as in COLMAP's model, up
// to the world's axes.
TEST(FindConventions, FindsHowAnotherProgramWritesPoses) {
  for (const Program& program : Programs()) {
    SCOPED_TRACE(program.name);
    const Model model = SceneOfColmap(1, /*outlier_ratio=*/0.1);
    const Model written = WrittenBy(program, model);
    const auto found = FindConventions(written);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->poses.has_w_last, program.writes_w_last);
    EXPECT_EQ(found->poses.is_world_from_cam, program.writes_camera_to_world);
    EXPECT_EQ(found->poses.has_centers, program.writes_centers);
    EXPECT_EQ(found->poses.is_left_handed, program.axes.determinant() < 0);
    EXPECT_EQ(found->intrinsics_factor, 1);
    EXPECT_FALSE(found->has_wrong_points);

    const std::vector<double> before = PixelErrors(model);
    const std::vector<double> after =
        PixelErrors(ConvertModel(written, *found));
    for (size_t e = 0; e < before.size(); ++e) {
      EXPECT_NEAR(after[e], before[e], 1e-6) << e;
    }
  }
}

TEST(FindConventions, SaysWhatChecksThenFind) {
  const Model model = SceneOfColmap(2, /*outlier_ratio=*/0.05);
  const Model written = WrittenBy(Programs()[4], model);
  const ModelCheck expected = CheckModel(model);
  const ModelCheck check = CheckModel(written);
  ASSERT_TRUE(check.conventions);
  EXPECT_TRUE(check.IsAnythingWrong());
  EXPECT_FALSE(expected.conventions);
  ASSERT_EQ(check.observations.size(), expected.observations.size());
  EXPECT_NEAR(*check.sigma_px, *expected.sigma_px, 1e-6);
  const Model cured = CureModel(written, check).model;
  EXPECT_FALSE(CheckModel(cured).conventions);
  EXPECT_NEAR(Summarize(PixelErrors(cured)).rms,
              Summarize(PixelErrors(CureModel(model, expected).model)).rms,
              1e-6);
}

TEST(FindConventions, FindsIntrinsicsOfPhotosOfAnotherSize) {
  for (const double factor : {0.25, 2.0}) {
    Model model = SceneOfColmap(3);
    const std::vector<double> before = PixelErrors(model);
    for (Camera& camera : model.cameras) {
      for (size_t i = 0; i < 3; ++i) camera.params[i] /= factor;
    }
    const auto found = FindConventions(model);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->intrinsics_factor, factor);
    EXPECT_EQ(found->poses.NumDifferences(), 0);
    const std::vector<double> after = PixelErrors(ConvertModel(model, *found));
    for (size_t e = 0; e < before.size(); ++e) {
      EXPECT_NEAR(after[e], before[e], 1e-6) << e;
    }
  }
}

TEST(FindConventions, HalvesNoPrincipalPointThatIsInTheMiddle) {
  for (const double factor : {0.5, 2.0}) {
    Model model = SceneOfColmap(3);
    for (Camera& camera : model.cameras) camera.params[0] *= factor;
    const auto found = FindConventions(model);
    EXPECT_TRUE(!found || found->intrinsics_factor == 1);
  }
}

// Pixels that count from another corner, or rows first. Where the principal
// point is not in the middle of the photo, no other poses fit as well.
TEST(FindConventions, FindsHowOtherProgramsCountPixels) {
  const Model model = [] {
    Model scene = SceneOfColmap(8, /*outlier_ratio=*/0.1);
    const Eigen::Vector2d offset(60, -40);
    scene.cameras[0].params[1] += offset.x();
    scene.cameras[0].params[2] += offset.y();
    for (Image& image : scene.images) {
      for (Point2D& point : image.points2D) {
        point.x += offset.x();
        point.y += offset.y();
      }
    }
    return scene;
  }();
  const double width = static_cast<double>(model.cameras[0].width);
  const double height = static_cast<double>(model.cameras[0].height);
  const std::vector<double> before = PixelErrors(model);
  using Writes = Point2D (*)(double x, double y, double width, double height);
  for (const Writes writes :
       std::vector<Writes>{[](double x, double y, double w, double) -> Point2D {
                             return {w - x, y};
                           },
                           [](double x, double y, double, double h) -> Point2D {
                             return {x, h - y};
                           },
                           [](double x, double y, double, double) -> Point2D {
                             return {y, x};
                           },
                           [](double x, double y, double w, double) -> Point2D {
                             return {y, w - x};
                           },
                           [](double x, double y, double, double h) -> Point2D {
                             return {h - y, x};
                           }}) {
    for (const bool writes_opengl : {false, true}) {
      Model written = writes_opengl ? WrittenBy(Programs()[4], model) : model;
      for (Image& image : written.images) {
        for (Point2D& point : image.points2D) {
          const Point2D pixel = writes(point.x, point.y, width, height);
          point.x = pixel.x;
          point.y = pixel.y;
        }
      }
      const auto found = FindConventions(written);
      ASSERT_TRUE(found);
      EXPECT_FALSE(found->pixel_from_file_axes.isIdentity());
      EXPECT_EQ(found->poses.NumDifferences() > 0, writes_opengl);
      const std::vector<double> after =
          PixelErrors(ConvertModel(written, *found));
      for (size_t e = 0; e < before.size(); ++e) {
        EXPECT_NEAR(after[e], before[e], 1e-6) << e;
      }
    }
  }
}

TEST(FindConventions, FindsHowPosesOfPanoramasAreWritten) {
  SceneOptions options = SceneOf(12, 200, 4, 0.5, 1);
  options.camera_model_id = 17;  // EQUIRECTANGULAR
  const Model model = SynthesizeScene(options).model;
  for (const Program& program : Programs()) {
    SCOPED_TRACE(program.name);
    const auto found = FindConventions(WrittenBy(program, model));
    ASSERT_TRUE(found);
    EXPECT_EQ(found->poses.is_world_from_cam, program.writes_camera_to_world);
    EXPECT_EQ(found->poses.is_left_handed, program.axes.determinant() < 0);
  }
}

TEST(FindConventions, FindsPointsThatAreNotWhereImagesSeeThem) {
  Model model = SceneOfColmap(4);
  const double before = Summarize(PixelErrors(model)).rms;
  for (Point3D& point : model.points3D) point.xyz *= -1;
  const auto found = FindConventions(model);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->has_wrong_points);
  EXPECT_EQ(found->poses.NumDifferences(), 0);
  EXPECT_EQ(found->intrinsics_factor, 1);
  const Model cured = CureModel(model, CheckModel(model)).model;
  EXPECT_LE(Summarize(PixelErrors(cured)).rms, before);
}

// The model is put right where poses and points of the file are: its cameras
// then are those with which it was made.
TEST(FindConventions, FindsIntrinsicsThatAllImagesAskFor) {
  const Model sound = SynthesizeScene(SceneOf(40, 400, 3, 0.3, 4)).model;
  using Spoils = void (*)(std::vector<double>*);
  for (const Spoils spoil : std::vector<Spoils>{
           [](std::vector<double>* f_cx_cy) { (*f_cx_cy)[1] += 8; },
           [](std::vector<double>* f_cx_cy) { (*f_cx_cy)[0] *= 1.05; },
           [](std::vector<double>* f_cx_cy) {
             std::swap((*f_cx_cy)[1], (*f_cx_cy)[2]);
           }}) {
    Model model = sound;
    for (Camera& camera : model.cameras) spoil(&camera.params);
    const auto found = FindConventions(model);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->NumDifferences(), 1);
    ASSERT_EQ(found->pixel_maps.size(), 1);
    EXPECT_EQ(found->pixel_maps[0].images.size(), 40);
    EXPECT_EQ(found->pixel_maps[0].cameras.size(), model.cameras.size());
    const Model converted = ConvertModel(model, *found);
    for (size_t c = 0; c < model.cameras.size(); ++c) {
      for (size_t i = 0; i < 3; ++i) {
        EXPECT_NEAR(converted.cameras[c].params[i], sound.cameras[c].params[i],
                    0.2);
      }
    }
    const ModelCheck check = CheckModel(model);
    EXPECT_TRUE(check.is_adjusted);
    EXPECT_EQ(check.NumImages(ImageVerdict::kWrong), 0);
    EXPECT_TRUE(check.observations.empty());
  }
}

TEST(FindConventions, FindsTheFocalLengthThatOneImageAsksFor) {
  Model model = SynthesizeScene(SceneOf(12, 400, 4, 0.3, 4)).model;
  Camera other = model.cameras[0];
  const double focal_length = other.params[0];
  other.id = 2;
  other.params[0] *= 1.3;
  model.cameras.push_back(other);
  model.images[3].camera_id = 2;
  UseTrivialRigs(&model);
  const auto found = FindConventions(model);
  ASSERT_TRUE(found);
  ASSERT_EQ(found->pixel_maps.size(), 1);
  EXPECT_EQ(found->pixel_maps[0].images, std::vector<int32_t>{3});
  const Model converted = ConvertModel(model, *found);
  EXPECT_NEAR(converted.cameras[1].params[0], focal_length,
              1e-3 * focal_length);
}

// Half of the images, or all: 2D points of photos of half the size, turned by
// 90 degrees, mirrored, cropped, normalised, or from the middle of the photo.
TEST(FindConventions, Finds2DPointsOfOtherPhotos) {
  const Model sound = SynthesizeScene(SceneOf(12, 400, 4, 0.3, 4)).model;
  const double width = static_cast<double>(sound.cameras[0].width);
  const double height = static_cast<double>(sound.cameras[0].height);
  using Matrix23 = Eigen::Matrix<double, 2, 3>;
  const auto map_of = [](double xx, double xy, double x, double yx, double yy,
                         double y) {
    Matrix23 map;
    map << xx, xy, x, yx, yy, y;
    return map;
  };
  const auto expect_found = [&](const Matrix23& map, size_t stride) {
    Model model = sound;
    std::vector<int32_t> images;
    for (size_t n = 0; n < model.images.size(); n += stride) {
      images.push_back(static_cast<int32_t>(n));
      for (Point2D& point : model.images[n].points2D) {
        const Eigen::Vector2d pixel = map * Vector3d(point.x, point.y, 1);
        point.x = pixel.x();
        point.y = pixel.y();
      }
    }
    const auto found = FindConventions(model);
    ASSERT_TRUE(found) << map;
    ASSERT_EQ(found->pixel_maps.size(), 1) << map;
    EXPECT_EQ(found->pixel_maps[0].images, images);
    EXPECT_TRUE(found->pixel_maps[0].cameras.empty());
    EXPECT_EQ(found->NumDifferences(), 1);
    const Model converted = ConvertModel(model, *found);
    for (size_t n = 0; n < model.images.size(); ++n) {
      for (size_t i = 0; i < model.images[n].points2D.size(); ++i) {
        const Point2D& before = sound.images[n].points2D[i];
        const Point2D& after = converted.images[n].points2D[i];
        EXPECT_NEAR(std::hypot(after.x - before.x, after.y - before.y), 0, 0.4);
      }
    }
  };
  for (const Matrix23& map :
       {map_of(0.5, 0, 0, 0, 0.5, 0), map_of(0, 1, 0, -1, 0, width),
        map_of(-1, 0, width, 0, 1, 0), map_of(1.1, 0, -60, 0, 1.1, -40)}) {
    expect_found(map, /*stride=*/2);
  }
  expect_found(map_of(1 / width, 0, 0, 0, 1 / height, 0), 1);
  expect_found(map_of(1, 0, -width / 2, 0, 1, -height / 2), 1);
}

// A small turn moves all pixels alike, up to the bend of the image plane.
TEST(FindConventions, TakesNoTurnForOtherPixels) {
  const Eigen::Quaterniond turn(
      Eigen::AngleAxisd(0.02, Vector3d(0.2, 1, 0).normalized()));
  Model model = SynthesizeScene(SceneOf(12, 400, 4, 0.3, 4)).model;
  for (size_t n = 0; n < 5; ++n) {
    Pose& pose = model.frames[n].rig_from_world;
    pose = ToPose(RigidTransform{turn.toRotationMatrix() * pose.Rotation(),
                                 turn * pose.translation});
  }
  EXPECT_FALSE(FindConventions(model));
  Model rig = RigSceneOfColmap();
  Pose& pose = *rig.rigs[0].sensors[1].sensor_from_rig;
  pose = ToPose(RigidTransform{turn.toRotationMatrix() * pose.Rotation(),
                               turn * pose.translation});
  EXPECT_FALSE(FindConventions(rig));
}

// Several programs write the sensors of a level rig alike, so it only counts
// that they are read as they were.
TEST(FindConventions, FindsHowSensorsOfRigsAreWritten) {
  const Model model = RigSceneOfColmap(/*outlier_ratio=*/0.1);
  EXPECT_FALSE(FindConventions(model));
  const std::vector<double> before = PixelErrors(model);
  for (const Program& program : Programs()) {
    for (const bool writes_frames_so : {false, true}) {
      SCOPED_TRACE(program.name);
      Model written = SensorsWrittenBy(program, model);
      if (writes_frames_so) written = WrittenBy(program, written);
      const auto found = FindConventions(written);
      ASSERT_TRUE(found);
      EXPECT_EQ(found->poses.NumDifferences() > 0, writes_frames_so);
      EXPECT_EQ(found->rig_factor, 1);
      const std::vector<double> after =
          PixelErrors(ConvertModel(written, *found));
      for (size_t e = 0; e < before.size(); ++e) {
        EXPECT_NEAR(after[e], before[e], 1e-6) << e;
      }
    }
  }
}

TEST(FindConventions, FindsRigsInAnotherUnitThanTheWorld) {
  Model model = RigSceneOfColmap();
  const double rms = Summarize(PixelErrors(model)).rms;
  for (RigSensor& sensor : model.rigs[0].sensors) {
    sensor.sensor_from_rig->translation *= 40;
  }
  const auto found = FindConventions(model);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->NumDifferences(), 1);
  EXPECT_NEAR(40 * found->rig_factor, 1, 0.01);
  EXPECT_LT(Summarize(PixelErrors(ConvertModel(model, *found))).rms, 1.2 * rms);
}

// One wrong sensor is a fault of the model, not a convention.
TEST(FindConventions, LeavesOneSensorThatIsWrittenOtherwise) {
  Model model = RigSceneOfColmap();
  Pose& pose = *model.rigs[0].sensors[1].sensor_from_rig;
  pose = ToPose(Inverse(pose.Transform()));
  EXPECT_FALSE(FindConventions(model));
}

// As for triangulation with known poses.
TEST(FindConventions, AsksTheMatchesWhereThereAreNoTracks) {
  const Model model = SceneOfColmap(5);
  const Database database = DatabaseOf(model);
  for (const Program& program : Programs()) {
    SCOPED_TRACE(program.name);
    Model written = WrittenBy(program, model);
    written.points3D.clear();
    written.track_elements.clear();
    const auto found = FindConventions(written, &database);
    ASSERT_TRUE(found);
    const Model converted = ConvertModel(written, *found);
    EXPECT_FALSE(FindConventions(converted, &database));
    EXPECT_FALSE(CheckPairs(converted, database).IsAnythingWrong());
    EXPECT_FALSE(FindConventions(written));
  }
}

}  // namespace
}  // namespace krot::internal
