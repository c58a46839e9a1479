#include "krot/analysis/noise.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "krot/camera/camera_model.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/oracle/dense_algebra.h"
#include "tests/testing/edit_model.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

SceneOptions SmallScene(int seed) { return SceneOf(10, 150, 4, 1, seed); }

// The observations as they are, at the true cameras and points.
Model Scene(const SceneOptions& options) {
  return SynthesizeScene(options).ground_truth;
}

void Move(Model* model, uint64_t e, double x, double y) {
  PixelOf(model, e).x += x;
  PixelOf(model, e).y += y;
}

int64_t Length(const Point3D& point) {
  return static_cast<int64_t>(point.track_end - point.track_begin);
}

// The track of one point as the definition has it: central differences of the
// projection, and a dense matrix R = I - A (A'A)^-1 A'.
struct DenseTrack {
  DenseTrack(const Model& model, size_t k, const Vector3d& xyz,
             const std::vector<double>& sigmas) {
    const std::vector<ImageGeometry> images = ImageGeometries(model);
    const auto indices = ImageIndices(model);
    const Point3D& point = model.points3D[k];
    const auto rows = static_cast<Eigen::Index>(2 * Length(point));
    Eigen::MatrixXd A(rows, 3);
    errors.resize(rows);
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = model.track_elements[e];
      const int32_t n = indices.at(element.image_id);
      const Camera& camera = model.cameras[images[n].camera];
      const Point2D& pixel = model.images[n].points2D[element.point2D_idx];
      const double sigma = sigmas.empty() ? 1 : sigmas[e];
      const auto error = [&](const Vector3d& x) -> Vector2d {
        return *ProjectionError(camera, {pixel.x, pixel.y},
                                images[n].cam_from_world * x) /
               sigma;
      };
      const auto row = static_cast<Eigen::Index>(2 * (e - point.track_begin));
      errors.segment<2>(row) = error(xyz);
      constexpr double kStep = 1e-5;
      for (int c = 0; c < 3; ++c) {
        const Vector3d step = kStep * Vector3d::Unit(c);
        A.block<2, 1>(row, c) =
            (error(xyz + step) - error(xyz - step)) / (2 * kStep);
      }
    }
    const LongMatrix A_long = A.cast<long double>();
    const LongMatrix I = LongMatrix::Identity(rows, rows);
    R = (I - A_long * LeastNormSolution(A_long, I)).cast<double>();
    slope = errors - R * errors;
  }

  Eigen::VectorXd errors;  // over their relative sigmas
  Eigen::VectorXd slope;   // what a step of the point would still take away
  Eigen::MatrixXd R;
};

// The median of chi^2 with one degree of freedom, by bisection.
double MedianOfChi2WithOne() {
  double low = 0, high = 1;
  for (int i = 0; i < 100; ++i) {
    const double middle = (low + high) / 2;
    (std::erf(std::sqrt(middle / 2)) < 0.5 ? low : high) = middle;
  }
  return low;
}

void ExpectNoiseByDefinition(const Model& model,
                             const std::vector<double>& sigmas = {}) {
  const ModelNoise noise = EstimateNoise(model, {0.05, sigmas}, {});
  ASSERT_TRUE(noise.sigma_px);
  int64_t num_tested = 0, num_below_median = 0;
  double redundancy = 0;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const DenseTrack track(model, k, noise.points[k], sigmas);
    EXPECT_LE(track.slope.norm(), 1e-4 * track.errors.norm() + 1e-7);
    const Point3D& point = model.points3D[k];
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const ObservationNoise& one = noise.observations[e];
      const auto row = static_cast<Eigen::Index>(2 * (e - point.track_begin));
      const Vector2d error = track.errors.segment<2>(row);
      EXPECT_NEAR(
          (one.error_px / (sigmas.empty() ? 1 : sigmas[e]) - error).norm(), 0,
          1e-6);
      const SymmetricEigen R_ii =
          EigenOfSymmetric(track.R.block<2, 2>(row, row));
      double chi2 = 0;
      int num_controlled = 0;
      for (int j = 0; j < 2; ++j) {
        const double r = R_ii.values[j];
        EXPECT_NEAR(one.redundancy[j], r, 1e-5);
        if (r < kControlled) continue;
        ++num_controlled;
        chi2 += std::pow(R_ii.vectors.col(j).dot(error), 2) /
                (r * *noise.sigma_px * *noise.sigma_px);
      }
      ASSERT_EQ(one.num_controlled, num_controlled);
      if (num_controlled == 0) {
        EXPECT_TRUE(std::isnan(one.w));
        continue;
      }
      // The same probability to be exceeded.
      const double probability = num_controlled == 2
                                     ? std::exp(-chi2 / 2)
                                     : std::erfc(std::sqrt(chi2 / 2));
      EXPECT_NEAR(std::exp(-one.w * one.w / 2) / probability, 1, 1e-2);
      ++num_tested;
      num_below_median += chi2 < (num_controlled == 2 ? 2 * std::log(2.0)
                                                      : MedianOfChi2WithOne());
      redundancy += R_ii.values.sum();
    }
  }
  EXPECT_EQ(noise.num_tested, num_tested);
  EXPECT_LE(std::abs(2 * num_below_median - num_tested), 2);
  EXPECT_NEAR(noise.degrees_of_freedom, std::pow(std::log(2.0), 2) * redundancy,
              1e-3 * redundancy);
  // The tail of w^2 / 2, which is F(2, nu).
  const double nu = noise.degrees_of_freedom;
  EXPECT_NEAR(std::pow(1 + noise.critical_w * noise.critical_w / nu, -nu / 2) *
                  static_cast<double>(num_tested),
              0.05, 1e-10);
}

TEST(EstimateNoise, IsByItsDefinitionForEveryCameraModel) {
  for (int id = 0; id <= 17; ++id) {
    SCOPED_TRACE(id);
    SceneOptions options = SmallScene(id);
    options.num_points = 60;
    options.camera_model_id = id;
    ExpectNoiseByDefinition(Scene(options));
  }
}

TEST(EstimateNoise, IsByItsDefinitionInRigs) {
  SceneOptions options = SmallScene(1);
  options.sensors_per_rig = 3;
  ExpectNoiseByDefinition(Scene(options));
}

TEST(EstimateNoise, IsByItsDefinitionWhereAnImageSeesAPointTwice) {
  SceneOptions options = SmallScene(2);
  options.duplicate_ratio = 0.3;
  ExpectNoiseByDefinition(Scene(options));
}

TEST(EstimateNoise, IsByItsDefinitionInTracksOfTwo) {
  SceneOptions options = SmallScene(3);
  options.track_length = 2;
  ExpectNoiseByDefinition(Scene(options));
}

TEST(EstimateNoise, IsByItsDefinitionWithWeights) {
  const Model model = Scene(SmallScene(4));
  std::mt19937_64 random(4);
  std::vector<double> sigmas(model.track_elements.size());
  for (double& sigma : sigmas) {
    sigma = std::uniform_real_distribution<double>(0.5, 2)(random);
  }
  ExpectNoiseByDefinition(model, sigmas);
}

TEST(EstimateNoise, DoesNotDependOnTheUnitOfTheWeights) {
  const Model model = Scene(SmallScene(5));
  const ModelNoise plain = EstimateNoise(model, {}, {});
  const std::vector<double> fours(model.track_elements.size(), 4);
  const ModelNoise scaled = EstimateNoise(model, {0.05, fours}, {});
  EXPECT_DOUBLE_EQ(*scaled.sigma_px * 4, *plain.sigma_px);
  for (size_t e = 0; e < fours.size(); ++e) {
    EXPECT_DOUBLE_EQ(scaled.observations[e].w, plain.observations[e].w);
  }
}

TEST(EstimateNoise, FindsTheSigmaAndTheTailsThatWerePutIn) {
  SceneOptions options = SmallScene(6);
  options.num_points = 4000;
  options.pixel_noise = 0.3;
  const ModelNoise noise = EstimateNoise(Scene(options), {}, {});
  // Five times the spread of the median.
  const double spread = std::sqrt(1 / (2 * noise.degrees_of_freedom));
  EXPECT_NEAR(*noise.sigma_px / 0.3, 1, 5 * spread);
  std::vector<double> w;
  for (const ObservationNoise& one : noise.observations) w.push_back(one.w);
  std::sort(w.begin(), w.end());
  const auto count = static_cast<double>(w.size());
  for (const double share : {0.1, 0.01, 0.001}) {
    const double above = static_cast<double>(
        w.end() -
        std::upper_bound(w.begin(), w.end(), std::sqrt(-2 * std::log(share))));
    EXPECT_NEAR(above, share * count, 5 * std::sqrt(share * count)) << share;
  }
  // A Cauchy loss of a dozen sigma is as good as none.
  EXPECT_GT(noise.cauchy_scale_px.value_or(100), 12 * 0.3);
}

TEST(EstimateNoise, OfAStudentsTFindsTheScaleOfItsLoss) {
  SceneOptions options = SmallScene(7);
  options.num_frames = 40;
  options.num_points = 800;
  options.track_length = 30;
  options.pixel_noise = 0;
  Model model = Scene(options);
  constexpr double kFreedom = 3;
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  for (Image& image : model.images) {
    for (Point2D& point2D : image.points2D) {
      const double scale = std::sqrt(
          kFreedom / std::chi_squared_distribution<double>(kFreedom)(random));
      point2D.x += scale * normal(random);
      point2D.y += scale * normal(random);
    }
  }
  const ModelNoise noise = EstimateNoise(model, {}, {});
  // Tracks mix a little of their observations' noise, which makes tails
  // lighter.
  EXPECT_NEAR(*noise.cauchy_scale_px / std::sqrt(kFreedom), 1, 0.1);
}

TEST(EstimateNoise, AlarmsNoMoreOftenThanPromised) {
  NoiseOptions options;
  options.false_alarm = 0.25;
  int num_alarms = 0;
  constexpr int kScenes = 80;
  for (int seed = 0; seed < kScenes; ++seed) {
    SceneOptions scene = SmallScene(100 + seed);
    scene.track_length = 2 + seed % 5;
    num_alarms += EstimateNoise(Scene(scene), options, {}).num_above > 0;
  }
  // Twenty and three times the spread of that.
  EXPECT_LE(num_alarms, 20 + 3 * std::sqrt(15.0));
  EXPECT_GE(num_alarms, 2);
}

TEST(EstimateNoise, TakesAPointAtInfinityForWhatItIs) {
  SceneOptions options = SmallScene(8);
  options.layout = SceneLayout::kStreet;
  Model model = Scene(options);
  const auto geometries = ImageGeometries(model);
  const auto indices = ImageIndices(model);
  std::mt19937_64 random(8);
  std::normal_distribution<double> normal;
  // Every point goes out along its mean ray, as far as doubles reach.
  for (Point3D& point : model.points3D) {
    const TrackElement& first = model.track_elements[point.track_begin];
    const RigidTransform& cam_from_world =
        geometries[indices.at(first.image_id)].cam_from_world;
    const Vector3d center = Center(cam_from_world);
    point.xyz = center + 1e12 * (point.xyz - center).normalized();
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const int32_t n = indices.at(model.track_elements[e].image_id);
      const Camera& camera = model.cameras[geometries[n].camera];
      const auto pixel =
          ProjectPoint(camera, geometries[n].cam_from_world * point.xyz);
      ASSERT_TRUE(pixel);
      PixelOf(&model, e).x = pixel->x() + normal(random);
      PixelOf(&model, e).y = pixel->y() + normal(random);
    }
  }
  const ModelNoise noise = EstimateNoise(model, {}, {});
  EXPECT_NEAR(*noise.sigma_px, 1, 0.15);
  EXPECT_EQ(noise.num_above, 0);
}

TEST(EstimateNoise, KnowsNothingWithoutPosesOrTracks) {
  Model model = Scene(SmallScene(9));
  for (Frame& frame : model.frames) {
    frame.rig_from_world.translation.x() =
        std::numeric_limits<double>::quiet_NaN();
  }
  for (const Model& unknown : {model, Model()}) {
    const ModelNoise noise = EstimateNoise(unknown, {}, {});
    EXPECT_FALSE(noise.sigma_px);
    EXPECT_EQ(noise.num_tested, 0);
    EXPECT_EQ(noise.num_above, 0);
    EXPECT_TRUE(SnoopNoise(unknown, {}, {}).removed.empty());
  }
}

TEST(EstimateNoise, FindsNothingWrongWithAModelWithoutNoise) {
  SceneOptions options = SmallScene(10);
  options.pixel_noise = 0;
  EXPECT_EQ(EstimateNoise(Scene(options), {}, {}).num_above, 0);
}

TEST(EstimateNoise, RefusesOptionsOutOfRange) {
  const Model model = Scene(SmallScene(11));
  for (const double alarm : {0.0, 1.0, -1.0}) {
    EXPECT_THROW(EstimateNoise(model, {alarm, {}}, {}), std::invalid_argument);
  }
  std::vector<double> sigmas(model.track_elements.size(), 1);
  sigmas[7] = 0;
  EXPECT_THROW(EstimateNoise(model, {0.05, sigmas}, {}), std::invalid_argument);
  EXPECT_THROW(SnoopNoise(model, {0.05, {1, 2}}, {}), std::invalid_argument);
}

std::set<uint64_t> Removed(const NoiseSnooping& snooping) {
  std::set<uint64_t> removed;
  for (const SnoopedObservation& one : snooping.removed) {
    removed.insert(one.element);
  }
  return removed;
}

TEST(SnoopNoise, RemovesWhatWasMovedAndHardlyAnythingElse) {
  size_t num_others = 0;
  for (int seed = 0; seed < 10; ++seed) {
    SceneOptions options = SmallScene(20 + seed);
    options.track_length = 7;
    Model model = Scene(options);
    const double sigma_px = *EstimateNoise(model, {}, {}).sigma_px;
    std::mt19937_64 random(seed);
    std::set<uint64_t> moved;
    for (const Point3D& point : model.points3D) {
      if (Length(point) < 5 || random() % 3 > 0) continue;
      const uint64_t e = point.track_begin + random() % Length(point);
      const double angle = std::uniform_real_distribution<double>(0, 6)(random);
      Move(&model, e, 40 * std::cos(angle), 40 * std::sin(angle));
      moved.insert(e);
    }
    ASSERT_GT(moved.size(), 10u);
    const NoiseSnooping snooping = SnoopNoise(model, {}, {});
    const std::set<uint64_t> removed = Removed(snooping);
    EXPECT_TRUE(std::includes(removed.begin(), removed.end(), moved.begin(),
                              moved.end()));
    num_others += removed.size() - moved.size();
    EXPECT_EQ(snooping.noise.num_above, 0);
    // A third of the tracks were bent, and are no more.
    EXPECT_GT(snooping.sigma_path_px.front(), 1.1 * sigma_px);
    EXPECT_NEAR(*snooping.noise.sigma_px, sigma_px, 0.1 * sigma_px);
    for (const SnoopedObservation& one : snooping.removed) {
      if (moved.count(one.element) > 0) {
        EXPECT_NEAR(one.error_px, 40, 8);
      }
      EXPECT_FALSE(one.is_of_two);
    }
  }
  // One in twenty models has an alarm by chance.
  EXPECT_LE(num_others, 2u);
}

// Two cameras side by side that look along z; 50 points with 0.1 px of noise.
Model TwoCameras(int num_cameras = 2) {
  Model model;
  model.cameras.push_back({1, 1, 1000, 1000, {1000, 1000, 500, 500}});
  model.images.resize(num_cameras);
  std::mt19937_64 random(1);
  std::normal_distribution<double> noise(0, 0.1);
  for (int n = 0; n < num_cameras; ++n) {
    Image& image = model.images[n];
    image.id = static_cast<ImageId>(n + 1);
    image.camera_id = 1;
    image.cam_from_world.translation.x() = -n;
  }
  for (int k = 0; k < 50; ++k) {
    Point3D point;
    point.id = static_cast<Point3DId>(k + 1);
    point.xyz = {0.1 * (k % 10), 0.2 * k / 10, 4};
    point.track_begin = model.track_elements.size();
    for (Image& image : model.images) {
      const Vector3d x = point.xyz + image.cam_from_world.translation;
      model.track_elements.push_back({image.id, static_cast<uint32_t>(k)});
      image.points2D.push_back({1000 * x.x() / x.z() + 500 + noise(random),
                                1000 * x.y() / x.z() + 500 + noise(random),
                                point.id});
    }
    point.track_end = model.track_elements.size();
    model.points3D.push_back(point);
  }
  UseTrivialRigs(&model);
  return model;
}

TEST(SnoopNoise, CannotTellWhichOfTwoIsWrong) {
  Model model = TwoCameras();
  Move(&model, 10, 0, 5);  // across the epipolar line
  const NoiseSnooping snooping = SnoopNoise(model, {}, {});
  EXPECT_EQ(Removed(snooping), (std::set<uint64_t>{10, 11}));
  for (const SnoopedObservation& one : snooping.removed) {
    EXPECT_TRUE(one.is_of_two);
    EXPECT_NEAR(one.error_px, 2.5, 0.5);  // a half each
  }
}

TEST(SnoopNoise, DoesNotCallSoundWhatNothingControls) {
  Model model = TwoCameras();
  Move(&model, 10, 30, 0);  // along the epipolar line
  const NoiseSnooping snooping = SnoopNoise(model, {}, {});
  EXPECT_TRUE(snooping.removed.empty());
  for (const ObservationNoise& one : snooping.noise.observations) {
    EXPECT_EQ(one.num_controlled, 1);
    EXPECT_NEAR(one.redundancy[0], 0, 1e-9);
    EXPECT_NEAR(one.redundancy[1], 0.5, 0.01);
  }
  // A third camera controls it.
  model = TwoCameras(3);
  Move(&model, 15, 30, 0);
  EXPECT_EQ(Removed(SnoopNoise(model, {}, {})), (std::set<uint64_t>{15}));
}

TEST(SnoopNoise, RemovesWhatDoesNotSeeItsPoint) {
  Model model = TwoCameras(4);
  // The last camera turns its back on all points.
  model.images[3].cam_from_world.quaternion_wxyz = {0, 0, 1, 0};
  model.images[3].cam_from_world.translation = {3, 0, 0};
  model.frames.clear();
  model.rigs.clear();
  UseTrivialRigs(&model);
  const ModelNoise noise = EstimateNoise(model, {}, {});
  EXPECT_EQ(noise.num_above, 50);
  const NoiseSnooping snooping = SnoopNoise(model, {}, {});
  ASSERT_EQ(snooping.removed.size(), 50u);
  for (const SnoopedObservation& one : snooping.removed) {
    EXPECT_EQ(one.element % 4, 3u);
    EXPECT_TRUE(std::isinf(one.w));
    EXPECT_TRUE(std::isnan(one.error_px));
  }
}

TEST(SnoopNoise, RemovesWhatHasItsPointInTheCamera) {
  Model model = TwoCameras(4);
  // COLMAP leaves such models: two cameras in one place, held together by a
  // point that lies in both, and fits them exactly.
  constexpr double kApart = 1e-11;
  model.images[3].cam_from_world.translation.x() =
      model.images[2].cam_from_world.translation.x() - kApart;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    model.images[3].points2D[k].x = model.images[2].points2D[k].x;
  }
  Point3D point;
  point.id = 51;
  point.xyz = {2, 0, 4 * kApart};
  point.track_begin = model.track_elements.size();
  model.track_elements.push_back({3, 50});
  model.track_elements.push_back({4, 50});
  point.track_end = model.track_elements.size();
  model.points3D.push_back(point);
  model.images[2].points2D.push_back({500, 500, 51});
  model.images[3].points2D.push_back({250, 500, 51});
  model.frames.clear();
  model.rigs.clear();
  UseTrivialRigs(&model);
  const NoiseSnooping snooping = SnoopNoise(model, {}, {});
  EXPECT_EQ(Removed(snooping),
            (std::set<uint64_t>{point.track_begin, point.track_begin + 1}));
  for (const SnoopedObservation& one : snooping.removed) {
    EXPECT_TRUE(std::isinf(one.w));
  }
}

TEST(SnoopNoise, KeepsMostWhereTheNoiseHasNoSigma) {
  SceneOptions options = SmallScene(30);
  options.pixel_noise = 0;
  options.num_points = 1000;
  Model model = Scene(options);
  std::mt19937_64 random(30);
  std::normal_distribution<double> normal;
  // Tracks from a hundredth of a pixel to a hundred.
  for (const Point3D& point : model.points3D) {
    const double sigma =
        std::pow(10, std::uniform_real_distribution<double>(-2, 2)(random));
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      Move(&model, e, sigma * normal(random), sigma * normal(random));
    }
  }
  const NoiseSnooping snooping = SnoopNoise(model, {}, {});
  EXPECT_GT(snooping.removed.size(), 0u);
  EXPECT_LT(2 * snooping.removed.size(), model.track_elements.size());
  EXPECT_FALSE(snooping.has_common_noise);
}

TEST(SnoopNoise, HasTheSameBitsAtAnyNumberOfThreads) {
  SceneOptions options = SmallScene(31);
  options.num_points = 2000;
  options.outlier_ratio = 0.05;
  const Model model = Scene(options);
  const NoiseSnooping a = SnoopNoise(model, {}, {1});
  const NoiseSnooping b = SnoopNoise(model, {}, {4});
  ASSERT_GT(a.removed.size(), 100u);
  ASSERT_EQ(a.removed.size(), b.removed.size());
  for (size_t n = 0; n < a.removed.size(); ++n) {
    EXPECT_EQ(a.removed[n].element, b.removed[n].element);
    EXPECT_EQ(a.removed[n].w, b.removed[n].w);
  }
  EXPECT_EQ(a.sigma_path_px, b.sigma_path_px);
  EXPECT_EQ(a.noise.points, b.noise.points);
}

}  // namespace
}  // namespace krot::internal
