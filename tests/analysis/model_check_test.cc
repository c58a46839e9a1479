#include "krot/check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/analysis/noise.h"
#include "krot/camera/camera_model.h"
#include "krot/model.h"
#include "krot/model/derived_models.h"
#include "krot/model/model_checks.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/oracle/dense_algebra.h"
#include "tests/testing/edit_model.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

Model Scene(int seed, int num_frames = 12, double track_length = 4,
            double pixel_noise = 1) {
  return SynthesizeScene(
             SceneOf(num_frames, 600, track_length, pixel_noise, seed))
      .ground_truth;
}

Frame& FrameOf(Model* model, size_t image) {
  return model->frames[ImageGeometries(*model)[image].frame];
}

// About its centre.
void Turn(Model* model, size_t image, double degrees,
          const Eigen::Vector3d& axis) {
  Pose& pose = FrameOf(model, image).rig_from_world;
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(degrees / 180 * std::acos(-1.0), axis.normalized())
          .toRotationMatrix();
  pose = ToPose({turn * pose.Rotation(), turn * pose.translation});
}

std::vector<ImageId> Images(const ModelCheck& check, ImageVerdict verdict) {
  std::vector<ImageId> ids;
  for (const ImageCheck& image : check.images) {
    if (image.verdict == verdict) ids.push_back(image.image_id);
  }
  return ids;
}

TEST(CheckModel, FindsNothingWrongWhereThereIsNothingButNoise) {
  int num_alarms = 0;
  for (int seed = 1; seed <= 20; ++seed) {
    const Model model = Scene(seed, 6 + seed, 2 + 0.2 * seed);
    const ModelCheck check = CheckModel(model);
    EXPECT_THAT(Images(check, ImageVerdict::kWrong), IsEmpty());
    num_alarms += check.IsAnythingWrong();
  }
  EXPECT_LE(num_alarms, 3);  // more by chance: once in 400
}

TEST(CheckModel, DoesNotCallAnImageWrongForNoiseThreeTimesAsLarge) {
  for (int seed = 1; seed <= 20; ++seed) {
    Model model = Scene(seed, 10, 3);
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise;
    for (size_t n = 0; n < 3; ++n) {
      for (Point2D& point : model.images[n].points2D) {
        point.x += std::sqrt(8.0) * noise(random);
        point.y += std::sqrt(8.0) * noise(random);
      }
    }
    EXPECT_THAT(Images(CheckModel(model), ImageVerdict::kWrong), IsEmpty());
  }
}

TEST(CheckModel, DoesNotCallANoisyImageWrongForKeepingFewOfIts2DPoints) {
  for (int seed = 1; seed <= 20; ++seed) {
    Model model = Scene(seed, 10, 3);
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise;
    std::vector<Point2D>& points = model.images[0].points2D;
    for (Point2D& point : points) {
      point.x += std::sqrt(3.0) * noise(random);
      point.y += std::sqrt(3.0) * noise(random);
    }
    points.resize(10 * points.size(), Point2D{});
    EXPECT_THAT(Images(CheckModel(model), ImageVerdict::kWrong), IsEmpty());
  }
}

TEST(CheckModel, FindsTurnedImagesAndBlamesNoNeighbour) {
  for (int seed = 1; seed <= 10; ++seed) {
    // Half of what sees a point of a short track is wrong.
    Model model = Scene(seed, 12, 2.5);
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal;
    for (const size_t n : {3, 4}) {
      Turn(&model, n, 1, {normal(random), normal(random), normal(random)});
    }
    const ModelCheck check = CheckModel(model);
    EXPECT_THAT(Images(check, ImageVerdict::kWrong),
                ElementsAre(model.images[3].id, model.images[4].id));
    EXPECT_LE(check.observations.size(), 2u);
    EXPECT_NEAR(*check.sigma_px, 1, 0.2);
    for (const WrongObservation& one : check.observations) {
      EXPECT_NE(one.image_id, model.images[3].id);
      EXPECT_NE(one.image_id, model.images[4].id);
    }
  }
}

// By a fifth of a degree: 3.6 pixels, of noise of one.
TEST(CheckModel, FindsAnImageWhoseObservationsAgreeOnAnotherPose) {
  for (int seed = 1; seed <= 10; ++seed) {
    Model model = Scene(seed, 12, 6);
    Turn(&model, 5, 0.2, {1, 2, 0});
    const ModelCheck check = CheckModel(model);
    EXPECT_THAT(Images(check, ImageVerdict::kWrong),
                ElementsAre(model.images[5].id));
    EXPECT_EQ(check.images[5].fault, ImageFault::kMisplaced);
  }
}

// What is left of a turned image whose points have followed it.
TEST(CheckModel, FindsAMisplacedImageByItsFewObservations) {
  for (int seed = 1; seed <= 10; ++seed) {
    Model model = Scene(seed, 12, 6);
    Turn(&model, 5, 0.2, {1, 2, 0});
    const ModelCheck check = CheckModel(WithFewObservationsOf(5, 20, model));
    EXPECT_THAT(Images(check, ImageVerdict::kWrong),
                ElementsAre(model.images[5].id));
  }
}

// Minimax solutions stand off their least squares by half of the noise.
TEST(CheckModel, AsksForAnAdjustmentWhereMostImagesAreMisplaced) {
  EXPECT_TRUE(CheckModel(Scene(1, 12, 6)).is_adjusted);
  for (const double degrees : {0.06, 0.2}) {
    Model model = Scene(1, 12, 6);
    for (size_t n = 0; n < model.images.size(); ++n) {
      Turn(&model, n, degrees, {1, n % 2 == 0 ? -0.5 : 0.5, 0});
    }
    const ModelCheck check = CheckModel(model);
    EXPECT_FALSE(check.is_adjusted);
    EXPECT_THAT(Images(check, ImageVerdict::kWrong), IsEmpty());
  }
}

// A camera and a rig for each image, all alike.
void GiveEachImageItsOwnCamera(Model* model) {
  for (size_t n = 1; n < model->images.size(); ++n) {
    Camera camera = model->cameras[0];
    Rig rig = model->rigs[0];
    camera.id += static_cast<CameraId>(n);
    rig.id += static_cast<RigId>(n);
    rig.ref_sensor_id->id = camera.id;
    Frame& frame = FrameOf(model, n);
    frame.rig_id = rig.id;
    frame.data[0].sensor_id.id = camera.id;
    model->images[n].camera_id = camera.id;
    model->cameras.push_back(camera);
    model->rigs.push_back(rig);
  }
}

TEST(CheckModel, BlamesTheFocalLengthThatStandsOut) {
  for (int seed = 1; seed <= 5; ++seed) {
    Model model = Scene(seed);
    GiveEachImageItsOwnCamera(&model);
    ValidateModel(model);
    EXPECT_THAT(Images(CheckModel(model), ImageVerdict::kWrong), IsEmpty());
    const double focal_length = model.cameras[0].params[0];
    // Turned as well, or the lens alone would be put right.
    const Eigen::AngleAxisd turn(0.1, Eigen::Vector3d::UnitY());
    for (const size_t n : {3, 7}) {
      model.cameras[n].params[0] *= 1.3;
      Pose& pose = model.frames[n].rig_from_world;
      pose = ToPose({turn * pose.Rotation(), turn * pose.translation});
    }
    const ModelCheck check = CheckModel(model);
    EXPECT_THAT(Images(check, ImageVerdict::kWrong),
                ElementsAre(model.images[3].id, model.images[7].id));
    for (const size_t n : {3, 7}) {
      EXPECT_EQ(check.images[n].fault, ImageFault::kLens);
      EXPECT_NEAR(check.images[n].focal_length_px, 1.3 * focal_length, 1e-9);
      EXPECT_NEAR(check.images[n].others_focal_length_px, focal_length, 1e-9);
    }
  }
}

// Zooms that differ are no fault by themselves.
TEST(CheckModel, BlamesNoFocalLengthThatTheObservationsAgreeWith) {
  Model model = Scene(1);
  GiveEachImageItsOwnCamera(&model);
  Camera& camera = model.cameras[3];
  ASSERT_EQ(camera.model_id, 2);  // SIMPLE_RADIAL
  camera.params[0] *= 2;
  for (Point2D& point : model.images[3].points2D) {
    point.x += point.x - camera.params[1];
    point.y += point.y - camera.params[2];
  }
  EXPECT_THAT(Images(CheckModel(model), ImageVerdict::kWrong), IsEmpty());
}

// Its partners are wrong and keep nothing, and what it keeps is noisy.
TEST(CheckModel, DoesNotCallANoisyImageChanceThatOthersTookItsTracksFrom) {
  for (int seed = 1; seed <= 10; ++seed) {
    Model model = Scene(seed, 12, 4, 0.4);
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise;
    std::uniform_real_distribution<double> uniform;
    for (uint64_t e = 0; e < model.track_elements.size(); ++e) {
      Point2D& pixel = PixelOf(&model, e);
      if (model.track_elements[e].image_id != model.images[5].id) {
        // Some of any image are up to the 4 pixels that COLMAP filters to.
        if (uniform(random) < 0.01) pixel.x += 4;
        continue;
      }
      pixel.x += noise(random);
      pixel.y += noise(random);
    }
    const ModelCheck check = CheckModel(WithFewObservationsOf(5, 40, model));
    EXPECT_THAT(Images(check, ImageVerdict::kWrong), IsEmpty());
  }
}

// Against sums over the density on a grid.
TEST(ErrorsInDisc, HasTheLikeliestDensityAndItsDivergence) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::normal_distribution<double> normal;
  for (const bool is_of_two : {false, true}) {
    for (const double lambda : {0.0, 0.5, 3.0, 40.0}) {
      std::vector<double> errors;  // up to 4 pixels, and some beyond
      while (errors.size() < 505) {
        const double sigma = 4 / std::sqrt(2 * lambda * (is_of_two ? 2 : 1));
        double error = is_of_two
                           ? sigma * std::abs(normal(random))
                           : sigma * std::hypot(normal(random), normal(random));
        if (lambda == 0) {
          error = 4 * std::pow(uniform(random), is_of_two ? 1 : 0.5);
        }
        if (error <= 4) errors.push_back(error);
        if (errors.size() % 101 == 100) errors.push_back(5);
      }
      const ErrorsInDisc disc =
          is_of_two ? ErrorsInDisc({}, errors, 4) : ErrorsInDisc(errors, {}, 4);
      EXPECT_EQ(disc.num(), 500);
      constexpr int kCells = 100000;
      // Over the radius, with u its square.
      const auto sum = [&](double l, const auto& value) {
        double all = 0, total = 0, even = 0;
        for (int n = 0; n < kCells; ++n) {
          const double r = (n + 0.5) / kCells;
          const double u = r * r * (is_of_two ? 2 : 1);
          const double size = is_of_two ? 1 : r;
          even += size;
          all += size * std::exp(-l * u);
          total += size * std::exp(-l * u) * value(u);
        }
        return std::make_pair(total / all, std::log(all / even));
      };
      const auto identity = [](double u) { return u; };
      const double mean = sum(disc.lambda(), identity).first;
      if (disc.lambda() > 0) {
        EXPECT_NEAR(mean, disc.mean(), 1e-6);
      }
      EXPECT_NEAR(disc.lambda(), lambda, 0.15 * lambda + 0.5);
      for (const double other : {0.0, 1.0, 10.0}) {
        const double divergence =
            sum(disc.lambda(),
                [&](double u) { return (other - disc.lambda()) * u; })
                .first +
            sum(other, identity).second - sum(disc.lambda(), identity).second;
        EXPECT_NEAR(disc.Exponent(other), 500 * divergence,
                    1e-3 * (1 + disc.Exponent(other)));
      }
    }
  }
}

// What COLMAP keeps of an image with a wrong pose.
TEST(CheckModel, FindsAnImageThatFitsByChanceWithinFourPixels) {
  for (int seed = 1; seed <= 10; ++seed) {
    Model model = Scene(seed, 12, 5, seed % 2 == 0 ? 1 : 0.6);
    const std::vector<ImageGeometry> images = ImageGeometries(model);
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> uniform(-4, 4);
    for (const Point3D& point : model.points3D) {
      for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
        if (model.track_elements[e].image_id != model.images[5].id) continue;
        const Camera& camera = model.cameras[images[5].camera];
        const auto pixel =
            ProjectPoint(camera, images[5].cam_from_world * point.xyz);
        Eigen::Vector2d error;
        do {
          error = {uniform(random), uniform(random)};
        } while (error.norm() > 4);
        PixelOf(&model, e).x = pixel->x() + error.x();
        PixelOf(&model, e).y = pixel->y() + error.y();
      }
    }
    const ModelCheck check = CheckModel(model);
    EXPECT_THAT(Images(check, ImageVerdict::kWrong),
                ElementsAre(model.images[5].id));
    EXPECT_EQ(check.images[5].fault, ImageFault::kChance);
  }
}

TEST(CheckModel, SaysOfWrongObservationsWhoseTheyAreAndByHowMuch) {
  Model model = Scene(1, 12, 6);
  size_t k = 0;
  while (model.points3D[k].track_end - model.points3D[k].track_begin < 5) ++k;
  const uint64_t e = model.points3D[k].track_begin + 1;
  PixelOf(&model, e).x += 30;
  const ModelCheck check = CheckModel(model);
  ASSERT_EQ(check.observations.size(), 1u);
  const WrongObservation& one = check.observations[0];
  EXPECT_EQ(one.element, e);
  EXPECT_EQ(one.image_id, model.track_elements[e].image_id);
  EXPECT_EQ(one.point2D_idx, model.track_elements[e].point2D_idx);
  EXPECT_EQ(one.point3D_id, model.points3D[k].id);
  EXPECT_NEAR(one.error_px, 30, 5);
  EXPECT_GT(one.w, check.critical_w);
  EXPECT_THAT(Images(check, ImageVerdict::kWrong), IsEmpty());
}

// The second half of a track sees where a point beside the first one projects.
TEST(CheckModel, TellsATrackOfTwoPointsFromScatteredMistakes) {
  Model model = Scene(2, 12, 9);
  const std::vector<ImageGeometry> images = ImageGeometries(model);
  const auto indices = ImageIndices(model);
  size_t k = 0;
  while (model.points3D[k].track_end - model.points3D[k].track_begin < 8) ++k;
  const Point3D& point = model.points3D[k];
  const Eigen::Vector3d other = point.xyz + Eigen::Vector3d(0.03, -0.02, 0.02);
  for (uint64_t e = point.track_end - 3; e < point.track_end; ++e) {
    const int32_t n = indices.at(model.track_elements[e].image_id);
    const Camera& camera = model.cameras[images[n].camera];
    const auto pixel = ProjectPoint(camera, images[n].cam_from_world * other);
    PixelOf(&model, e).x = pixel->x();
    PixelOf(&model, e).y = pixel->y();
  }
  const Point3D& scattered = model.points3D[k + 1];
  PixelOf(&model, scattered.track_begin).x += 40;
  PixelOf(&model, scattered.track_begin + 1).y += 40;
  const ModelCheck check = CheckModel(model);
  ASSERT_EQ(check.tracks.size(), 1u);
  EXPECT_EQ(check.tracks[0].point3D_id, point.id);
  EXPECT_EQ(check.tracks[0].num_second, 3);
  EXPECT_EQ(check.tracks[0].num_first + 3,
            static_cast<int64_t>(point.track_end - point.track_begin));
  EXPECT_LT((check.tracks[0].second - other).norm(), 0.005);
}

// The inverse of all normal equations of one image and of all points that it
// sees, from central differences of the projection.
TEST(CheckModel, KnowsHowFirmlyAnImageIsHeld) {
  const Model model = Scene(3, 6, 3);
  const ModelCheck check = CheckModel(model);
  ASSERT_FALSE(check.IsAnythingWrong());
  const std::vector<ImageGeometry> images = ImageGeometries(model);
  const auto indices = ImageIndices(model);
  const size_t image = 2;
  std::vector<size_t> points;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    for (uint64_t e = model.points3D[k].track_begin;
         e < model.points3D[k].track_end; ++e) {
      if (model.track_elements[e].image_id == model.images[image].id) {
        points.push_back(k);
      }
    }
  }
  const auto size = static_cast<Eigen::Index>(6 + 3 * points.size());
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(size, size);
  for (size_t j = 0; j < points.size(); ++j) {
    const Point3D& point = model.points3D[points[j]];
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const int32_t n = indices.at(model.track_elements[e].image_id);
      const Camera& camera = model.cameras[images[n].camera];
      const RigidTransform pose = images[n].cam_from_world;
      const auto pixel = [&](const Eigen::VectorXd& u) -> Eigen::Vector2d {
        const Eigen::Vector3d turn = u.head<3>();
        const Eigen::Vector3d x =
            pose * Eigen::Vector3d(check.points[points[j]] + u.tail<3>() -
                                   u.segment<3>(3));
        const Eigen::Vector3d x_cam =
            turn.norm() > 0
                ? Eigen::Vector3d(
                      Eigen::AngleAxisd(turn.norm(), turn.normalized()) * x)
                : x;
        return *ProjectPoint(camera, x_cam);
      };
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(2, size);
      for (int c = 0; c < 9; ++c) {
        if (c < 6 && n != static_cast<int32_t>(image)) continue;
        constexpr double kStep = 1e-6;
        const Eigen::VectorXd step = kStep * Eigen::VectorXd::Unit(9, c);
        const Eigen::Index column =
            c < 6 ? c : static_cast<Eigen::Index>(6 + 3 * j) + c - 6;
        J.col(column) = (pixel(step) - pixel(-step)) / (2 * kStep);
      }
      N += J.transpose() * J;
    }
  }
  const Eigen::MatrixXd covariance =
      *check.sigma_px * *check.sigma_px *
      SolveByLu(N, Eigen::MatrixXd::Identity(N.rows(), N.cols()));
  const auto largest = [&](Eigen::Index begin) {
    return std::sqrt(
        EigenOfSymmetric(covariance.block<3, 3>(begin, begin)).values[2]);
  };
  const ImageCheck& one = check.images[image];
  EXPECT_NEAR(one.center_sigma, largest(3), 1e-4 * largest(3));
  EXPECT_NEAR(one.turn_sigma_deg, largest(0) * 180 / std::acos(-1.0),
              1e-4 * one.turn_sigma_deg);
}

Eigen::Vector2d Position(const Point2D& point) { return {point.x, point.y}; }

// The image keeps the observations nearest to one of its own.
Model WithObservationsInOneCorner(size_t image, size_t num_kept,
                                  const Model& model) {
  const Image& kept = model.images[image];
  const Eigen::Vector2d corner = Position(kept.points2D[0]);
  const auto distance = [&](const Point2D& point) {
    return (Position(point) - corner).norm();
  };
  std::vector<double> distances;
  for (const Point2D& point : kept.points2D) {
    distances.push_back(distance(point));
  }
  std::sort(distances.begin(), distances.end());
  return Without(model, [&](uint64_t e) {
    const TrackElement& element = model.track_elements[e];
    return element.image_id == kept.id &&
           distance(kept.points2D[element.point2D_idx]) >= distances[num_kept];
  });
}

TEST(CheckModel, CallsAnImageWeaklyHeldWhoseObservationsAreInOneCorner) {
  const Model model = WithObservationsInOneCorner(7, 17, Scene(4, 10, 5));
  const ModelCheck check = CheckModel(model);
  EXPECT_THAT(Images(check, ImageVerdict::kWeaklyHeld),
              ElementsAre(model.images[7].id));
  EXPECT_FALSE(check.IsAnythingWrong());
}

TEST(CheckModel, DoesNotCallTwoImagesWeaklyHeldWhoseDistanceIsTheUnit) {
  const ModelCheck check = CheckModel(Scene(2, 2, 2));
  EXPECT_EQ(check.NumImages(ImageVerdict::kFine), 2);
}

// The image has no 2D points that see nothing.
Model WithTracksForAllOf(size_t image, Model model) {
  std::vector<Point2D> kept;
  for (TrackElement& element : model.track_elements) {
    if (element.image_id != model.images[image].id) continue;
    kept.push_back(model.images[image].points2D[element.point2D_idx]);
    element.point2D_idx = static_cast<uint32_t>(kept.size() - 1);
  }
  model.images[image].points2D = std::move(kept);
  return model;
}

// Less than half of them contradict, but more than three times the noise would
// have, and what agrees does not hold the image, whether it lost tracks or not.
TEST(CheckModel, CallsAnImageWrongThatIsWeaklyHeldAndContradicted) {
  SceneOptions options = SceneOf(10, 6000, 5, 1);
  const Model scene = SynthesizeScene(options).ground_truth;
  for (const int percent : {0, 10, 45}) {
    for (const bool keeps_few : {true, false}) {
      Model model = WithObservationsInOneCorner(7, 120, scene);
      if (!keeps_few) model = WithTracksForAllOf(7, std::move(model));
      const ImageId id = model.images[7].id;
      int num = 0;
      for (size_t e = 0; e < model.track_elements.size(); ++e) {
        if (model.track_elements[e].image_id != id) continue;
        if (++num * percent % 100 < percent) PixelOf(&model, e).y += 40;
      }
      const ModelCheck check = CheckModel(model);
      if (percent < 45) {
        EXPECT_THAT(Images(check, ImageVerdict::kWrong), IsEmpty()) << percent;
        continue;
      }
      EXPECT_THAT(Images(check, ImageVerdict::kWrong), ElementsAre(id));
      EXPECT_EQ(check.images[7].fault, ImageFault::kUnsupported);
      EXPECT_GT(check.images[7].num_tested, 2 * check.images[7].num_wrong);
    }
  }
}

TEST(CheckModel, CallsAnImageWrongThatNothingHolds) {
  for (const int num_kept : {0, 1, 4}) {
    const Model model = WithFewObservationsOf(7, num_kept, Scene(4, 10, 5));
    const ModelCheck check = CheckModel(model);
    EXPECT_THAT(Images(check, ImageVerdict::kWrong),
                ElementsAre(model.images[7].id));
    EXPECT_EQ(check.images[7].fault, ImageFault::kUnsupported);
    EXPECT_THAT(check.observations, IsEmpty());
  }
}

// What only a wrong image could check speaks neither for nor against the other
// one.
TEST(CheckModel, DoesNotCallAnImageWrongForHavingAWrongNeighbourAlone) {
  Model model = Scene(4, 10, 5);
  const ImageId wrong = model.images[7].id;
  const ImageId alone = model.images[6].id;
  std::map<Point3DId, std::set<ImageId>> images_of;
  for (const Point3D& point : model.points3D) {
    for (const TrackElement& element : TrackOf(model, point)) {
      images_of[point.id].insert(element.image_id);
    }
  }
  model = Without(model, [&](uint64_t e) {
    const std::set<ImageId>& images = images_of[PixelOf(&model, e).point3D_id];
    const ImageId id = model.track_elements[e].image_id;
    const bool sees_both = images.count(alone) > 0 && images.count(wrong) > 0;
    return sees_both ? id != alone && id != wrong : id == alone;
  });
  Turn(&model, 7, 20, {1, 2, 0});
  const ModelCheck check = CheckModel(model);
  EXPECT_THAT(Images(check, ImageVerdict::kWrong), ElementsAre(wrong));
  EXPECT_EQ(check.images[6].num_tested, 0);
  EXPECT_EQ(check.images[6].verdict, ImageVerdict::kWeaklyHeld);
}

TEST(CheckModel, SaysNothingOfImagesWhereAllHaveFewObservations) {
  Model model = Scene(4, 10, 5);
  std::map<ImageId, int> num;
  model = Without(model, [&](uint64_t e) {
    return ++num[model.track_elements[e].image_id] > 12;
  });
  EXPECT_THAT(Images(CheckModel(model), ImageVerdict::kWrong), IsEmpty());
}

// It has contradictions, but so few that three times the noise would have them,
// and hardly anything else is left of it.
TEST(CheckModel, NeedsLessEvidenceWhereTracksKeepLittleOfAnImage) {
  Model model = WithFewObservationsOf(7, 20, Scene(4, 10, 5));
  Turn(&model, 7, 0.2, {1, 2, 0});
  EXPECT_THAT(Images(CheckModel(model), ImageVerdict::kWrong),
              ElementsAre(model.images[7].id));
}

// Adds views registered by hand: poses of the user's own, and nothing else.
Model WithNovelViews(Model model, int num) {
  const std::vector<ImageGeometry> images = ImageGeometries(model);
  for (size_t n = 0; n < images.size(); ++n) {
    model.images[n].cam_from_world = ToPose(images[n].cam_from_world);
  }
  for (int n = 0; n < num; ++n) {
    Image view = model.images[n];
    view.id = 1000 + static_cast<ImageId>(n);
    view.name = "novel" + std::to_string(n) + ".jpg";
    view.points2D.clear();
    view.cam_from_world.translation.x() += 5 + n;
    model.images.push_back(view);
  }
  UseTrivialRigs(&model);
  ValidateModel(model);
  return model;
}

// However many there are beside those that can be judged.
TEST(CheckModel, DoesNotJudgeImagesWithoutAny2DPointAndTheCureKeepsThem) {
  const Model sound = WithNovelViews(Scene(4, 10, 5), 10);
  const ModelCheck fine = CheckModel(sound);
  EXPECT_FALSE(fine.IsAnythingWrong());
  EXPECT_EQ(fine.NumImages(ImageVerdict::kFine), 10);
  EXPECT_EQ(fine.NumImages(ImageVerdict::kNotJudged), 10);
  EXPECT_EQ(fine.NumImages(ImageVerdict::kWeaklyHeld), 0);
  EXPECT_THAT(fine.parts, IsEmpty());

  Model model = sound;
  Turn(&model, 7, 3, {1, 2, 0});
  const ModelCheck check = CheckModel(model);
  EXPECT_THAT(Images(check, ImageVerdict::kWrong),
              ElementsAre(model.images[7].id));
  EXPECT_EQ(check.NumImages(ImageVerdict::kNotJudged), 10);
  const Model cured = CureModel(model, check).model;
  ASSERT_EQ(cured.images.size(), model.images.size() - 1);
  for (size_t n = 10; n < model.images.size(); ++n) {
    EXPECT_EQ(cured.images[n - 1].name, model.images[n].name);
    EXPECT_EQ(ImageGeometries(cured)[n - 1].cam_from_world.translation,
              ImageGeometries(model)[n].cam_from_world.translation);
  }
}

TEST(CheckModel, JudgesAnImageWithout2DPointsByItsMatches) {
  Model model = WithFewObservationsOf(5, 0, Scene(7));
  model.images[5].points2D.clear();
  EXPECT_EQ(CheckModel(model).images[5].verdict, ImageVerdict::kNotJudged);
  const Database database = DatabaseOf(Scene(7));
  ModelCheckOptions options;
  options.database = &database;
  EXPECT_EQ(CheckModel(model, options).images[5].verdict, ImageVerdict::kFine);
  Turn(&model, 5, 3, {1, 2, 0});
  const ModelCheck check = CheckModel(model, options);
  EXPECT_THAT(Images(check, ImageVerdict::kWrong),
              ElementsAre(model.images[5].id));
}

// Its frame stands where the other camera's observations hold it.
TEST(CheckModel, TakesAnImageWithout2DPointsToBeHeldByItsFrame) {
  SceneOptions options = SceneOf(8, 400, 6, 0.5, 3);
  options.sensors_per_rig = 2;
  options.has_rigs = true;
  Model model =
      WithFewObservationsOf(5, 0, SynthesizeScene(options).ground_truth);
  model.images[5].points2D.clear();
  const ModelCheck check = CheckModel(model);
  EXPECT_EQ(check.NumImages(ImageVerdict::kFine), 16);
}

TEST(CheckModel, HasNoVerdictWithoutPositions) {
  Model model = Scene(1);
  for (Frame& frame : model.frames) {
    frame.rig_from_world.translation.setConstant(
        std::numeric_limits<double>::quiet_NaN());
  }
  const ModelCheck check = CheckModel(model);
  EXPECT_FALSE(check.sigma_px);
  EXPECT_FALSE(check.IsAnythingWrong());
}

TEST(CheckModel, NamesPairsOfImagesThatAreTheSamePhoto) {
  Model model = Scene(1);
  EXPECT_THAT(CheckModel(model).same_photos, IsEmpty());
  // Image 3 becomes a copy of image 5.
  Model copy = model;
  copy.track_elements.clear();
  copy.images[3].points2D = model.images[5].points2D;
  for (Point3D& point : copy.points3D) {
    const Track track = TrackOf(model, point);
    point.track_begin = copy.track_elements.size();
    for (const TrackElement& element : track) {
      if (element.image_id == model.images[3].id) continue;
      copy.track_elements.push_back(element);
      if (element.image_id != model.images[5].id) continue;
      copy.track_elements.push_back({model.images[3].id, element.point2D_idx});
    }
    point.track_end = copy.track_elements.size();
  }
  FrameOf(&copy, 3).rig_from_world = FrameOf(&copy, 5).rig_from_world;
  const ModelCheck check = CheckModel(copy);
  EXPECT_THAT(check.same_photos, ElementsAre(std::array<int32_t, 2>{3, 5}));
  EXPECT_EQ(check.NumImages(ImageVerdict::kWrong), 0);
}

// A hood or a time stamp: all images of the first points see them at the same
// pixels, to half a pixel.
Model WithHood(const Model& sound, size_t num_points) {
  Model model = sound;
  std::mt19937 generator(1);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  const IdIndex<ImageId> image_of(model.images);
  for (size_t k = 0; k < num_points; ++k) {
    const Point3D& point = model.points3D[k];
    std::optional<Point2D> first;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = model.track_elements[e];
      Point2D& pixel = model.images[*image_of.Find(element.image_id)]
                           .points2D[element.point2D_idx];
      if (!first) first = pixel;
      pixel.x = first->x + uniform(generator);
      pixel.y = first->y + uniform(generator);
    }
  }
  return model;
}

TEST(CheckModel, NamesWhatStaysAtItsPixelsWhileCamerasTurn) {
  const Model sound = Scene(1);
  EXPECT_THAT(CheckModel(sound).still_points, IsEmpty());
  const Model model = WithHood(sound, 30);
  std::vector<int32_t> of_three;
  for (int32_t k = 0; k < 30; ++k) {
    const Point3D& point = sound.points3D[k];
    if (point.track_end - point.track_begin > 2) of_three.push_back(k);
  }
  const ModelCheck check = CheckModel(model);
  EXPECT_EQ(check.still_points, of_three);
  EXPECT_TRUE(check.IsAnythingWrong());
  EXPECT_THAT(check.cameras, IsEmpty());
  const Model cured = CureModel(model, check).model;
  const IdIndex<Point3DId> cured_points(cured.points3D);
  for (const int32_t k : of_three) {
    EXPECT_FALSE(cured_points.Find(model.points3D[k].id));
  }
}

TEST(CheckModel, TakesWhatStaysForDistantWhereCamerasDoNotTurn) {
  Model model = WithHood(Scene(1), 30);
  for (Frame& frame : model.frames) {
    frame.rig_from_world.quaternion_wxyz = {1, 0, 0, 0};
  }
  EXPECT_THAT(CheckModel(model).still_points, IsEmpty());
}

TEST(CheckModel, FindsImagesThatAreFarOffAmongAQuarterOfAll) {
  for (int seed = 1; seed <= 5; ++seed) {
    Model model = Scene(seed, 12, 5);
    for (const size_t n : {2, 6, 9}) {
      FrameOf(&model, n).rig_from_world = {};
    }
    const ModelCheck check = CheckModel(model);
    EXPECT_THAT(Images(check, ImageVerdict::kWrong),
                ElementsAre(model.images[2].id, model.images[6].id,
                            model.images[9].id));
    EXPECT_NEAR(*check.sigma_px, 1, 0.1);
  }
}

TEST(CheckModel, HasTheSameBitsAtAnyNumberOfThreads) {
  Model model = Scene(5);
  Turn(&model, 2, 2, {1, 2, 3});
  const ModelCheck a = CheckModel(model, {}, {1});
  const ModelCheck b = CheckModel(model, {}, {4});
  EXPECT_EQ(*a.sigma_px, *b.sigma_px);
  EXPECT_EQ(a.points, b.points);
  for (size_t n = 0; n < a.images.size(); ++n) {
    EXPECT_EQ(a.images[n].verdict, b.images[n].verdict);
    EXPECT_EQ(a.images[n].center_sigma, b.images[n].center_sigma);
  }
}

TEST(CureModel, LeavesOutWhatIsWrongAndFitsBetter) {
  for (const bool is_legacy : {false, true}) {
    Model model = Scene(6);
    Turn(&model, 2, 3, {1, 2, 3});
    PixelOf(&model, model.points3D[7].track_begin).x += 50;
    if (is_legacy) {
      model.stores_rigs = false;
      for (size_t n = 0; n < model.images.size(); ++n) {
        model.images[n].cam_from_world =
            ToPose(ImageGeometries(model)[n].cam_from_world);
      }
    }
    const ModelCheck check = CheckModel(model);
    const Model cured = CureModel(model, check, {}, {}).model;
    ValidateModel(cured);
    EXPECT_EQ(cured.images.size() + 1, model.images.size());
    EXPECT_EQ(cured.frames.size() + 1, model.frames.size());
    for (const Image& image : cured.images) {
      EXPECT_NE(image.id, model.images[2].id);
    }
    EXPECT_LT(Summarize(PixelErrors(cured)).max, 7);
    EXPECT_FALSE(CheckModel(cured).IsAnythingWrong());
  }
}

// Nothing else is wrong: images and their observations are sound.
TEST(CheckModel, FindsPointsFarFromWhereTheirImagesSeeThemAndMovesThem) {
  const Model sound = Scene(9);
  Model model = sound;
  std::vector<int32_t> moved;
  for (size_t k = 0; k < model.points3D.size(); k += 3) {
    model.points3D[k].xyz += Eigen::Vector3d(0.3, -0.2, 0.1);
    moved.push_back(static_cast<int32_t>(k));
  }
  const ModelCheck check = CheckModel(model);
  EXPECT_EQ(check.misplaced_points, moved);
  EXPECT_TRUE(check.IsAnythingWrong());
  EXPECT_THAT(check.observations, IsEmpty());
  EXPECT_THAT(CheckModel(sound).misplaced_points, IsEmpty());
  const Model cured = CureModel(model, check).model;
  EXPECT_EQ(cured.track_elements.size(), model.track_elements.size());
  EXPECT_LT(Summarize(PixelErrors(cured)).rms,
            1.01 * Summarize(PixelErrors(sound)).rms);
}

// Every observation sees another point than it says.
TEST(CheckModel, SaysThatNothingFitsWhereTracksAreExchanged) {
  Model model = Scene(10);
  EXPECT_TRUE(CheckModel(model).fits);
  for (Image& image : model.images) {
    for (size_t i = 1; i < image.points2D.size(); ++i) {
      std::swap(image.points2D[i - 1].x, image.points2D[i].x);
      std::swap(image.points2D[i - 1].y, image.points2D[i].y);
    }
  }
  const ModelCheck check = CheckModel(model);
  EXPECT_FALSE(check.fits);
  EXPECT_TRUE(check.IsAnythingWrong());
  EXPECT_THAT(check.misplaced_points, IsEmpty());
}

TEST(CheckModel, CallsNoImageOfAnExactModelWrong) {
  for (int seed = 1; seed <= 10; ++seed) {
    const ModelCheck check = CheckModel(Scene(seed, 40, 4, 0));
    EXPECT_THAT(Images(check, ImageVerdict::kWrong), IsEmpty());
  }
}

TEST(CureModel, CopiesAModelThatNothingIsWrongWith) {
  const Model model = Scene(1);
  const ModelCheck check = CheckModel(model);
  ASSERT_FALSE(check.IsAnythingWrong());
  const Model cured = CureModel(model, check, {}, {}).model;
  ASSERT_EQ(cured.points3D.size(), model.points3D.size());
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    EXPECT_EQ(cured.points3D[k].xyz, model.points3D[k].xyz);
    EXPECT_EQ(cured.points3D[k].error, model.points3D[k].error);
  }
}

TEST(CheckModel, AsksTheMatchesThatTheModelDoesNotHold) {
  // As COLMAP's mapper leaves an image whose pose is wrong: without what
  // contradicts that.
  Model model = WithFewObservationsOf(5, 0, Scene(7));
  const Database database = DatabaseOf(Scene(7));
  ModelCheckOptions options;
  options.database = &database;
  EXPECT_THAT(Images(CheckModel(model, options, {}), ImageVerdict::kWrong),
              IsEmpty());
  Turn(&model, 5, 3, {1, 2, 0});
  const ModelCheck check = CheckModel(model, options, {});
  EXPECT_THAT(Images(check, ImageVerdict::kWrong),
              ElementsAre(model.images[5].id));
  EXPECT_EQ(check.images[5].fault, ImageFault::kMatches);
  EXPECT_EQ(check.pairs->images[5].fault, PoseFault::kRotation);
  const ModelCure cure = CureModel(model, check, options, {});
  EXPECT_EQ(cure.model.images.size(), model.images.size() - 1);
  EXPECT_THAT(cure.moved, IsEmpty());
}

TEST(CureModel, MovesAnImageWhosePositionAloneIsWrong) {
  const Model sound = Scene(7);
  const Database database = DatabaseOf(sound);
  ModelCheckOptions options;
  options.database = &database;
  Model model = sound;
  Pose& pose = FrameOf(&model, 5).rig_from_world;
  pose.translation += Eigen::Vector3d(0.1, -0.05, 0.1);
  const ModelCheck check = CheckModel(model, options, {});
  EXPECT_THAT(Images(check, ImageVerdict::kWrong),
              ElementsAre(model.images[5].id));
  const ModelCure cure = CureModel(model, check, options, {});
  EXPECT_THAT(cure.moved, ElementsAre(model.images[5].name));
  ASSERT_EQ(cure.model.images.size(), model.images.size());
  const auto center_of = [](const Model& of) {
    return Center(ImageGeometries(of)[5].cam_from_world);
  };
  EXPECT_LT((center_of(cure.model) - center_of(sound)).norm(), 0.01);
  EXPECT_FALSE(CheckModel(cure.model, options, {}).pairs->IsAnythingWrong());
  EXPECT_EQ(CheckPoses(cure.model).num_stale, 0);
  ValidateModel(cure.model);
}

TEST(CheckModel, TakesTheNoiseOfLargeKeypointsToBeLarger) {
  Model model = Scene(7);
  Database database = DatabaseOf(model);
  database.scales.assign(model.images.size(), {});
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise;
  for (size_t n = 0; n < model.images.size(); ++n) {
    for (Point2D& point : model.images[n].points2D) {
      // Every tenth has five times the noise, which the scene's own is small
      // beside.
      const bool is_large = database.scales[n].size() % 10 == 0;
      database.scales[n].push_back(is_large ? 50 : 2);
      point.x += (is_large ? 15 : 3) * noise(random);
      point.y += (is_large ? 15 : 3) * noise(random);
    }
  }
  ModelCheckOptions options;
  options.database = &database;
  EXPECT_GT(CheckModel(model).observations.size(), 30u);
  const ModelCheck check = CheckModel(model, options, {});
  EXPECT_LE(check.observations.size(), 2u);
  EXPECT_EQ(check.median_scale_px, 2);
  EXPECT_NEAR(*check.sigma_px, std::sqrt(10.0), 0.15);
}

TEST(CheckModel, OfPosesWithoutTracksAsksTheMatchesAlone) {
  Model model = Scene(7);
  const Database database = DatabaseOf(model);
  Turn(&model, 5, 3, {1, 2, 0});
  model = Without(model, [](uint64_t) { return true; });
  ModelCheckOptions options;
  options.database = &database;
  const ModelCheck check = CheckModel(model, options, {});
  EXPECT_FALSE(check.sigma_px);
  EXPECT_THAT(Images(check, ImageVerdict::kWrong),
              ElementsAre(model.images[5].id));
  EXPECT_EQ(CureModel(model, check, options, {}).model.images.size(), 11u);
}

}  // namespace
}  // namespace krot::internal
