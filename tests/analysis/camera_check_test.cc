#include "krot/analysis/camera_check.h"

#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/camera/camera_model.h"
#include "krot/check.h"
#include "krot/linear/blocks.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"

namespace krot::internal {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using ::testing::IsEmpty;
using ::testing::SizeIs;

Model RigScene(int seed, int num_frames, int num_points, int num_sensors = 3) {
  SceneOptions options;
  options.num_frames = num_frames;
  options.num_points = num_points;
  options.track_length = 5;
  options.pixel_noise = 1;
  options.sensors_per_rig = num_sensors;
  options.random_seed = static_cast<uint64_t>(seed);
  return SynthesizeScene(options).ground_truth;
}

// The images of a frame see the same points.
Model LargeRigScene() {
  SceneOptions options;
  options.num_frames = 30;
  options.num_points = 2000;
  options.pixel_noise = 0.5;
  options.sensors_per_rig = 3;
  options.camera_model_id = 2;  // SIMPLE_RADIAL
  return SynthesizeScene(options).ground_truth;
}

Pose Turned(const Pose& pose, const Vector3d& rotation, const Vector3d& shift) {
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(rotation.norm(), rotation.normalized())
          .toRotationMatrix();
  const Vector3d center = -pose.Rotation().transpose() * pose.translation;
  const Eigen::Matrix3d R = turn * pose.Rotation();
  return ToPose({R, -R * (center + shift)});
}

Pose& PlaceOf(Model* model, size_t sensor) {
  return *model->rigs[0].sensors[sensor].sensor_from_rig;
}

TEST(FindWrongCameras, FindsNoneWhereThereIsNothingButNoise) {
  for (int seed = 1; seed <= 20; ++seed) {
    const Model model = RigScene(seed, 4 + seed, 600, 1 + seed % 4);
    EXPECT_THAT(CheckModel(model).cameras, IsEmpty());
  }
}

// Nor where noise differs by camera: its size is no fault.
TEST(FindWrongCameras, FindsNoneWhereACameraIsNoisier) {
  for (int seed = 1; seed <= 10; ++seed) {
    Model model = RigScene(seed, 12, 600);
    std::mt19937_64 generator(static_cast<uint64_t>(seed));
    std::normal_distribution<double> more(0, std::sqrt(8));
    for (Image& image : model.images) {
      if (image.camera_id != model.cameras[1].id) continue;
      for (Point2D& point : image.points2D) {
        point.x += more(generator);
        point.y += more(generator);
      }
    }
    EXPECT_THAT(CheckModel(model).cameras, IsEmpty());
  }
}

// The images of a frame have one pose. Where they see the same points, they
// outvote other frames, and do not speak against each other.
TEST(AddUpFrames, FindsAFrameThatIsTurned) {
  for (const double degrees : {0.2, 0.5, 1.0}) {
    Model model = LargeRigScene();
    Pose& pose = model.frames[7].rig_from_world;
    // About the middle of the scene, so that most errors stay small.
    const Eigen::AngleAxisd turn(degrees / 180 * std::acos(-1.0),
                                 Vector3d(0.6, 0.64, 0.48));
    pose =
        ToPose({turn.toRotationMatrix() * pose.Rotation(), pose.translation});
    const ModelCheck check = CheckModel(model);
    for (size_t n = 0; n < model.images.size(); ++n) {
      EXPECT_EQ(check.images[n].verdict == ImageVerdict::kWrong, n / 3 == 7)
          << degrees << " degrees, " << check.images[n].name;
    }
    EXPECT_THAT(check.cameras, IsEmpty());
  }
}

// Where the others contradict its images so clearly that all are called wrong.
TEST(FindWrongCameras, BlamesACameraAllOfWhoseImagesAreWrong) {
  SceneOptions options;
  options.layout = SceneLayout::kStreet;
  options.num_points = 3000;
  options.pixel_noise = 0.5;
  options.sensors_per_rig = 5;
  options.rig_rotation_deg = 37;
  options.rig_baseline = 0.05;
  options.outlier_ratio = 0.1;
  Model model = SynthesizeScene(options).ground_truth;
  Pose& place = PlaceOf(&model, 1);
  place = Turned(place, {0.02, 0.01, 0}, Vector3d::Zero());
  const ModelCheck check = CheckModel(model);
  ASSERT_THAT(check.cameras, SizeIs(1));
  EXPECT_EQ(check.cameras[0].camera_id, model.rigs[0].sensors[1].sensor_id.id);
  EXPECT_EQ(check.cameras[0].fault, CameraFault::kImages);
  EXPECT_EQ(check.cameras[0].num_images, 20);
  EXPECT_EQ(check.NumImages(ImageVerdict::kWrong), 20);
  EXPECT_FALSE(check.is_adjusted);
}

// Steps from far off may be absurd: here the sensors' quaternions have w last.
TEST(FindWrongCameras, AsksForNoNegativeFocalLength) {
  Model model = LargeRigScene();
  for (size_t s = 0; s < 2; ++s) {
    auto& [w, x, y, z] = PlaceOf(&model, s).quaternion_wxyz;
    PlaceOf(&model, s).quaternion_wxyz = {x, y, z, w};
  }
  for (const WrongCamera& camera : CheckConverted(model, {}, {}).cameras) {
    if (camera.fault != CameraFault::kFocalLength) continue;
    EXPECT_GT(camera.asked_focal_length_px, 0);
  }
}

// All images of that camera look misplaced, and those of its neighbours.
TEST(FindWrongCameras, FindsACameraThatIsTurnedInItsRig) {
  for (const double degrees : {0.5, 2.0, 5.0}) {
    Model model = RigScene(1, 12, 600);
    Pose& place = PlaceOf(&model, 1);
    const Vector3d turn =
        degrees / 180 * std::acos(-1.0) * Vector3d(1, 2, -1).normalized();
    place = Turned(place, turn, Vector3d::Zero());
    const ModelCheck check = CheckModel(model);
    ASSERT_THAT(check.cameras, SizeIs(1)) << degrees;
    EXPECT_EQ(check.cameras[0].camera_id,
              model.rigs[0].sensors[1].sensor_id.id);
    EXPECT_EQ(check.cameras[0].fault, CameraFault::kPlaceInRig);
    EXPECT_EQ(check.cameras[0].num_images, 12);
    EXPECT_NEAR(check.cameras[0].turn_deg, degrees, 0.05 * degrees);
    EXPECT_EQ(check.NumImages(ImageVerdict::kWrong), 0);
    EXPECT_FALSE(check.is_adjusted);
    EXPECT_TRUE(check.IsAnythingWrong());
  }
}

TEST(FindWrongCameras, FindsTheDistortionOfOneOfTwoCameras) {
  Model model = RigScene(1, 20, 1000, 2);
  model.cameras[1].params[3] += 0.1;
  const ModelCheck check = CheckModel(model);
  ASSERT_THAT(check.cameras, SizeIs(1));
  EXPECT_EQ(check.cameras[0].camera_id, model.cameras[1].id);
  EXPECT_EQ(check.cameras[0].fault, CameraFault::kDistortion);
}

// The errors of a model, each divided by its relative sigma, after small steps
// from where `noise` has its points: three numbers each by which frames
// turn and move, the same of the second camera's place, and three of each
// point.
class Linearized {
 public:
  // Keeps a reference to noise.
  Linearized(const Model& model, const ModelNoise& noise)
      : model_(model), noise_(noise), image_of_(ImagesOfElements(model)) {
    for (size_t k = 0; k < noise.points.size(); ++k) {
      model_.points3D[k].xyz = noise.points[k];
    }
  }

  VectorXd Errors() const {
    const std::vector<ImageGeometry> geometries = ImageGeometries(model_);
    VectorXd errors(2 * model_.track_elements.size());
    for (const Point3D& point : model_.points3D) {
      for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
        const ImageGeometry& geometry = geometries[image_of_[e]];
        const Point2D& pixel =
            model_.images[image_of_[e]]
                .points2D[model_.track_elements[e].point2D_idx];
        errors.segment<2>(static_cast<Eigen::Index>(2 * e)) =
            *ProjectionError(model_.cameras[geometry.camera],
                             {pixel.x, pixel.y},
                             geometry.cam_from_world * point.xyz) /
            noise_.observations[e].relative_sigma;
      }
    }
    return errors;
  }

  // By how much the sum of squares falls, to first order, if all poses and
  // points are free, with or without the camera's place.
  double Fall(bool frees_place) {
    std::vector<VectorXd> columns;
    const auto add = [&](const std::function<void(double)>& step) {
      const Model kept = model_;
      step(1e-5);
      const VectorXd above = Errors();
      model_ = kept;
      step(-1e-5);
      columns.push_back((above - Errors()) / 2e-5);
      model_ = kept;
    };
    const auto add_pose = [&](const std::function<Pose&()>& pose) {
      for (int i = 0; i < 3; ++i) {
        const Vector3d axis = Vector3d::Unit(i);
        add([&](double h) {
          pose() = Turned(pose(), h * axis, Vector3d::Zero());
        });
        add([&](double h) { pose() = Turned(pose(), {0, 0, 0}, h * axis); });
      }
    };
    for (Frame& frame : model_.frames) {
      const auto n = &frame - model_.frames.data();
      add_pose(
          [this, n]() -> Pose& { return model_.frames[n].rig_from_world; });
    }
    if (frees_place) {
      add_pose([this]() -> Pose& { return PlaceOf(&model_, 1); });
    }
    for (size_t k = 0; k < model_.points3D.size(); ++k) {
      for (int i = 0; i < 3; ++i) {
        add([&](double h) { model_.points3D[k].xyz[i] += h; });
      }
    }
    const VectorXd errors = Errors();
    MatrixXd J(errors.size(), static_cast<Eigen::Index>(columns.size()));
    for (size_t c = 0; c < columns.size(); ++c) {
      J.col(static_cast<Eigen::Index>(c)) = columns[c].normalized();
    }
    const Eigenpairs of_JJ = EigenpairsOf(J.transpose() * J);
    const VectorXd along = of_JJ.vectors.transpose() * (J.transpose() * errors);
    double fall = 0;
    for (Eigen::Index j = 0; j < J.cols(); ++j) {
      if (of_JJ.values[j] < 1e-10) continue;  // a motion of everything
      fall += along[j] * along[j] / of_JJ.values[j];
    }
    return fall;
  }

 private:
  Model model_;
  const ModelNoise& noise_;
  const std::vector<int32_t> image_of_;
};

// Of FindWrongCameras, with noise of the same size everywhere or of sizes that
// are known.
void ExpectGainOfSquares(const std::vector<double>& sizes) {
  Model model = RigScene(2, 5, 60);
  Pose& place = PlaceOf(&model, 1);
  place = Turned(place, {0.02, 0.01, -0.01}, {0.001, 0, 0});
  NoiseOptions options;
  for (size_t e = 0; e < model.track_elements.size() && !sizes.empty(); ++e) {
    options.relative_sigmas.push_back(sizes[e % sizes.size()]);
  }
  const ModelNoise noise = EstimateNoise(model, options, {});
  ASSERT_EQ(noise.num_tested,
            static_cast<int64_t>(model.track_elements.size()));
  const std::vector<PoseSums> sums = AddUpImages(model, noise);
  const std::vector<WrongCamera> wrong =
      FindWrongCameras(model, noise, true, false, 0.05, 1);
  ASSERT_THAT(wrong, SizeIs(1));
  ASSERT_EQ(wrong[0].fault, CameraFault::kPlaceInRig);
  double square = 0;
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  for (size_t n = 0; n < sums.size(); ++n) {
    if (geometries[n].sensor == 1) square += sums[n].square;
  }
  Linearized linearized(model, noise);
  const double fall = linearized.Fall(true) - linearized.Fall(false);
  EXPECT_LT(fall, square);
  EXPECT_NEAR(wrong[0].gain, fall / square, 1e-4);
}

TEST(FindWrongCameras, GainsWhatFreeingTheCameraTakesFromTheSumOfSquares) {
  ExpectGainOfSquares({});
}

TEST(FindWrongCameras, WeighsObservationsByTheSizeOfTheirNoise) {
  ExpectGainOfSquares({0.5, 1, 2, 4, 0.7, 1.5, 3});
}

// A scene of one camera whose 2D points have been moved by `move`, from the
// principal point.
template <typename Move>
Model MovedPixels(int model_id, const Move& move) {
  SceneOptions options;
  options.num_frames = 12;
  options.num_points = 1500;
  options.pixel_noise = 0.5;
  options.camera_model_id = model_id;
  Model model = SynthesizeScene(options).ground_truth;
  const Camera& camera = model.cameras[0];
  const Eigen::Vector2d middle(camera.params[model_id == 1 ? 2 : 1],
                               camera.params[model_id == 1 ? 3 : 2]);
  for (Image& image : model.images) {
    for (Point2D& point : image.points2D) {
      const Eigen::Vector2d moved =
          middle + move(Eigen::Vector2d(point.x, point.y) - middle);
      point.x = moved.x();
      point.y = moved.y();
    }
  }
  return model;
}

std::vector<WrongCamera> WrongCamerasOf(const Model& model, bool errors_agree) {
  return FindWrongCameras(model, EstimateNoise(model, {}, {}), true,
                          errors_agree, 0.05, 1);
}

TEST(FindWrongCameras, FindsNoneWhereOneThatCanDoMoreGainsNothing) {
  for (const int model_id : {0, 1, 2, 3}) {
    const Model model =
        MovedPixels(model_id, [](const Eigen::Vector2d& x) { return x; });
    EXPECT_THAT(WrongCamerasOf(model, true), IsEmpty());
  }
}

TEST(FindWrongCameras, FindsADistortionThatTheModelDoesNotHave) {
  const Model model = MovedPixels(1, [](const Eigen::Vector2d& x) {
    return Eigen::Vector2d(x * (1 + 3e-8 * x.squaredNorm()));
  });
  const std::vector<WrongCamera> wrong = WrongCamerasOf(model, false);
  ASSERT_THAT(wrong, SizeIs(1));
  EXPECT_EQ(wrong[0].fault, CameraFault::kLens);
  EXPECT_EQ(wrong[0].model_name, "PINHOLE");
}

// By comparing all pairs.
double ErrorCorrelationOfAllPairs(const Model& model, const ModelNoise& noise) {
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  const std::vector<int32_t> point_of = PointsOfElements(model);
  const auto pixel = [&](size_t e) {
    const Point2D& point =
        model.images[image_of[e]].points2D[model.track_elements[e].point2D_idx];
    return Eigen::Vector2d(point.x, point.y);
  };
  double products = 0, squares = 0, num = 0;
  for (size_t e = 0; e < image_of.size(); ++e) {
    double least = 1e300;
    size_t nearest = e;
    for (size_t f = 0; f < image_of.size(); ++f) {
      const double distance = (pixel(f) - pixel(e)).norm();
      if (image_of[f] != image_of[e] || point_of[f] == point_of[e] ||
          distance < 10 || distance >= least) {
        continue;
      }
      least = distance;
      nearest = f;
    }
    if (nearest == e) continue;
    const Eigen::Vector2d &one = noise.observations[e].error_px,
                          &other = noise.observations[nearest].error_px;
    products += one.dot(other);
    squares += (one.squaredNorm() + other.squaredNorm()) / 2;
    ++num;
  }
  return products / squares - 3 / std::sqrt(num);
}

TEST(ErrorCorrelation, IsHighWhereErrorsDependOnThePlaceAndLowForNoise) {
  const Model model =
      MovedPixels(1, [](const Eigen::Vector2d& x) { return x; });
  ModelNoise noise = EstimateNoise(model, {}, {});
  EXPECT_LT(ErrorCorrelation(model, noise), 0.05);
  EXPECT_NEAR(ErrorCorrelation(model, noise),
              ErrorCorrelationOfAllPairs(model, noise), 1e-12);
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  for (size_t e = 0; e < noise.observations.size(); ++e) {
    const Point2D& pixel =
        model.images[image_of[e]].points2D[model.track_elements[e].point2D_idx];
    noise.observations[e].error_px +=
        Eigen::Vector2d(std::sin(pixel.x / 100), std::cos(pixel.y / 100));
  }
  EXPECT_GT(ErrorCorrelation(model, noise), 0.4);
  EXPECT_NEAR(ErrorCorrelation(model, noise),
              ErrorCorrelationOfAllPairs(model, noise), 1e-12);
}

// The rounding of stored numbers depends on the place, too.
TEST(ErrorCorrelation, IsZeroWhereThereIsNoNoise) {
  SceneOptions options;
  options.num_frames = 8;
  options.num_points = 300;
  const Model model = SynthesizeScene(options).ground_truth;
  ModelNoise noise = EstimateNoise(model, {}, {});
  for (ObservationNoise& one : noise.observations) one.error_px.setOnes();
  EXPECT_EQ(ErrorCorrelation(model, noise), 0);
  noise.sigma_px = 1;
  EXPECT_GT(ErrorCorrelation(model, noise), 0.8);
}

}  // namespace
}  // namespace krot::internal
