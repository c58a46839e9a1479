#include "krot/analysis/noise.h"

#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/camera/camera_model.h"
#include "krot/model.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using ::testing::IsEmpty;
using ::testing::SizeIs;

Model TwentyFrames(int seed, int sensors_per_rig = 1) {
  SceneOptions options = SceneOf(20, 800, 5, 1, seed);
  options.sensors_per_rig = sensors_per_rig;
  return SynthesizeScene(options).ground_truth;
}

// Whether the image's frame is one of the last eight.
std::vector<char> InSecond(const Model& model) {
  std::vector<char> is_second;
  for (const ImageGeometry& geometry : ImageGeometries(model)) {
    is_second.push_back(geometry.frame >= 12);
  }
  return is_second;
}

// Cuts all tracks between the first twelve frames and the others but for
// `num_left` of those that two images of both see.
Model Cut(const Model& model, int num_left) {
  const std::vector<char> is_second = InSecond(model);
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  std::vector<char> is_removed(model.track_elements.size(), 0);
  for (const Point3D& point : model.points3D) {
    int count[2] = {0, 0};
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      ++count[static_cast<int>(is_second[image_of[e]])];
    }
    if (count[0] > 1 && count[1] > 1 && num_left-- > 0) continue;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const bool is_fewer = is_second[image_of[e]] != (count[1] > count[0]);
      is_removed[e] = count[0] > 0 && count[1] > 0 && is_fewer;
    }
  }
  return RemoveObservations(model, is_removed).model;
}

std::vector<ModelPart> PartsOf(const Model& model) {
  return FindLooseParts(model, EstimateNoise(model, {}, {}));
}

// So much that a part on few tracks is loose.
ModelNoise LargeNoise(const Model& model) {
  NoiseOptions options;
  options.sigma_px = 20;
  return EstimateNoise(model, options, {});
}

TEST(FindLooseParts, FindsNoneInScenesThatHangTogether) {
  for (int seed = 1; seed <= 20; ++seed) {
    EXPECT_THAT(PartsOf(TwentyFrames(seed)), IsEmpty());
  }
}

TEST(FindLooseParts, FindsAPartThatSharesNoTrack) {
  const Model model = Cut(TwentyFrames(1), 0);
  const std::vector<ModelPart> parts = PartsOf(model);
  ASSERT_THAT(parts, SizeIs(1));
  EXPECT_EQ(parts[0].num_tracks, 0);
  EXPECT_TRUE(std::isinf(parts[0].center_sigma));
  const std::vector<char> is_second = InSecond(model);
  EXPECT_THAT(parts[0].images, SizeIs(8));
  for (const int32_t n : parts[0].images) EXPECT_TRUE(is_second[n]);
}

// A part has seven degrees of freedom, and a track takes three of them. Two
// points leave the turn about the line through them.
TEST(FindLooseParts, KnowsThatTwoTracksHoldNoPartAndThreeDo) {
  const std::vector<ModelPart> two = PartsOf(Cut(TwentyFrames(1), 2));
  ASSERT_THAT(two, SizeIs(1));
  EXPECT_EQ(two[0].num_tracks, 2);
  EXPECT_TRUE(std::isinf(two[0].center_sigma));
  for (const ModelPart& part : PartsOf(Cut(TwentyFrames(1), 3))) {
    EXPECT_EQ(part.num_tracks, 3);
    EXPECT_TRUE(std::isfinite(part.center_sigma));
  }
}

// One image of the rest sees the part's points as before, however large the
// part is.
TEST(FindLooseParts, KnowsThatASingleImageGivesAPartNoScale) {
  const Model model = TwentyFrames(1);
  const std::vector<char> is_second = InSecond(model);
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  std::vector<char> is_removed(model.track_elements.size(), 0);
  for (const Point3D& point : model.points3D) {
    int num_second = 0;
    bool has_link = false;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      num_second += is_second[image_of[e]];
      has_link |= image_of[e] == 0;
    }
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      is_removed[e] = has_link && num_second > 1
                          ? is_second[image_of[e]] == 0 && image_of[e] != 0
                          : num_second > 0 && is_second[image_of[e]] == 0;
    }
  }
  const std::vector<ModelPart> parts =
      PartsOf(RemoveObservations(model, is_removed).model);
  ASSERT_THAT(parts, SizeIs(1));
  EXPECT_THAT(parts[0].images, SizeIs(8));
  EXPECT_GT(parts[0].num_tracks, 20);
  EXPECT_TRUE(std::isinf(parts[0].center_sigma));
}

// Rigs of two cameras give both parts their scale.
TEST(FindLooseParts, CountsOnTheScaleThatRigsGive) {
  const Model with_scale = Cut(TwentyFrames(1, 2), 4);
  Model without = with_scale;
  for (Rig& rig : without.rigs) {
    for (RigSensor& sensor : rig.sensors) {
      sensor.sensor_from_rig->translation.setZero();
    }
  }
  const std::vector<ModelPart> held =
      FindLooseParts(with_scale, LargeNoise(with_scale));
  const std::vector<ModelPart> loose =
      FindLooseParts(without, LargeNoise(without));
  ASSERT_THAT(held, SizeIs(1));
  ASSERT_THAT(loose, SizeIs(1));
  EXPECT_LT(held[0].center_sigma, loose[0].center_sigma);
}

// The pixel of x in the camera after the similarity of its part.
Eigen::Vector2d PixelAfter(const Model& model, const ImageGeometry& geometry,
                           const Eigen::VectorXd& theta, const Vector3d& origin,
                           const Vector3d& x) {
  const Vector3d omega = theta.segment<3>(3);
  const Eigen::Matrix3d turn =
      omega.norm() > 0 ? Eigen::AngleAxisd(omega.norm(), omega.normalized())
                             .toRotationMatrix()
                       : Eigen::Matrix3d::Identity();
  const Vector3d away = Center(geometry.cam_from_world) - origin;
  const Vector3d center =
      origin + theta.head<3>() + (1 + theta[6]) * (turn * away);
  return *ProjectPoint(
      model.cameras[geometry.camera],
      geometry.cam_from_world.rotation * turn.transpose() * (x - center));
}

TEST(FindLooseParts, KnowsHowFarNoiseMovesAPart) {
  const Model model = Cut(TwentyFrames(1), 4);
  const ModelNoise noise = LargeNoise(model);
  const std::vector<ModelPart> parts = FindLooseParts(model, noise);
  ASSERT_THAT(parts, SizeIs(1));

  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const std::vector<char> is_second = InSecond(model);
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  Vector3d origin = Vector3d::Zero();
  for (const int32_t n : parts[0].images) {
    origin += Center(geometries[n].cam_from_world) / 8;
  }
  // Seven unknowns of the part, and three of every point that both sides see.
  std::vector<size_t> shared;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const Point3D& point = model.points3D[k];
    bool has[2] = {false, false};
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      has[static_cast<int>(is_second[image_of[e]])] = true;
    }
    if (has[0] && has[1]) shared.push_back(k);
  }
  ASSERT_THAT(shared, SizeIs(4));
  const auto size = static_cast<Eigen::Index>(7 + 3 * shared.size());
  MatrixXd H = MatrixXd::Zero(size, size);
  for (size_t s = 0; s < shared.size(); ++s) {
    const Point3D& point = model.points3D[shared[s]];
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      MatrixXd J(2, size);
      for (Eigen::Index j = 0; j < size; ++j) {
        const auto pixel = [&](double step) {
          Eigen::VectorXd unknowns = Eigen::VectorXd::Zero(size);
          unknowns[j] = step;
          return PixelAfter(
              model, geometries[image_of[e]],
              is_second[image_of[e]] != 0 ? unknowns.head(7).eval()
                                          : Eigen::VectorXd::Zero(7).eval(),
              origin,
              noise.points[shared[s]] +
                  unknowns.segment<3>(7 + 3 * static_cast<Eigen::Index>(s)));
        };
        J.col(j) = (pixel(1e-5) - pixel(-1e-5)) / 2e-5;
      }
      H += J.transpose() * J;
    }
  }
  const MatrixXd covariance = H.fullPivLu().inverse().topLeftCorner(7, 7) *
                              std::pow(*noise.sigma_px, 2);
  double sum = 0;
  for (const int32_t n : parts[0].images) {
    const Vector3d away = Center(geometries[n].cam_from_world) - origin;
    MatrixXd K(3, 7);
    K << Eigen::Matrix3d::Identity(), Vector3d::UnitX().cross(away),
        Vector3d::UnitY().cross(away), Vector3d::UnitZ().cross(away), away;
    sum += (K * covariance * K.transpose()).trace() / 8;
  }
  EXPECT_NEAR(parts[0].center_sigma, std::sqrt(sum), 1e-4 * std::sqrt(sum));
}

TEST(FindLastingFaults, CountsPartsAndPointsInTheirCamera) {
  const Model whole = TwentyFrames(1);
  EXPECT_EQ(FindLastingFaults(whole).num_parts, 1);
  EXPECT_EQ(FindLastingFaults(whole).num_in_camera, 0);

  Model model = Cut(whole, 0);
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  Point3D& point = model.points3D[5];
  point.xyz = Center(
      ImageGeometries(model)[image_of[point.track_begin]].cam_from_world);
  const LastingFaults faults = FindLastingFaults(model);
  EXPECT_EQ(faults.num_parts, 2);
  EXPECT_EQ(faults.num_images_outside, 8);
  EXPECT_EQ(faults.num_images, 20);
  EXPECT_EQ(faults.num_in_camera, 1);
}

// In slow28 two pairs of cameras are in one place, and in longtracks92 errors
// have no common size.
TEST(CureModel, LeavesNothingThatIsWrongInRealModels) {
  const char* root = std::getenv("KROT_REAL_MODELS");
  if (root == nullptr) GTEST_SKIP() << "KROT_REAL_MODELS is not set";
  for (const char* name : {"slow28", "longtracks92", "task41_rigs_frames"}) {
    const Model model = ReadModel(std::string(root) + "/" + name);
    const ModelCheck check = CheckModel(model, {}, {});
    EXPECT_TRUE(check.IsAnythingWrong()) << name;
    EXPECT_EQ(check.NumImages(ImageVerdict::kWrong), 0) << name;
    const ModelCure cure = CureModel(model, check, {}, {});
    EXPECT_FALSE(CheckModel(cure.model, {}, {}).IsAnythingWrong()) << name;
  }
}

}  // namespace
}  // namespace krot::internal
