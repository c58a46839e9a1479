#include "krot/analysis/model_comparison.h"

#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <vector>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/base/numbers.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

Similarity SomeSimilarity() {
  return {2.5, AngleAxisd(1.2, Vector3d(1, -2, 3).normalized()).matrix(),
          Vector3d(4, -5, 6)};
}

// Cameras anywhere; in the second model where x2 puts those of the first, with
// x1 = similarity * x2.
std::vector<PosePair> MovedPoses(size_t count, const Similarity& similarity) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto normal3 = [&]() -> Vector3d {
    return {normal(random), normal(random), normal(random)};
  };
  std::vector<PosePair> poses(count);
  for (PosePair& pose : poses) {
    pose.cam_from_world1_rotation =
        AngleAxisd(normal(random), normal3().normalized()).matrix();
    pose.cam_from_world2_rotation =
        pose.cam_from_world1_rotation * similarity.rotation;
    pose.center1 = 10 * normal3();
    pose.center2 = similarity.rotation.transpose() *
                   (pose.center1 - similarity.translation) / similarity.scale;
  }
  return poses;
}

void ExpectNear(const Similarity& a, const Similarity& b, double tolerance) {
  EXPECT_NEAR(a.scale, b.scale, tolerance);
  EXPECT_LE((a.rotation - b.rotation).norm(), tolerance);
  EXPECT_LE((a.translation - b.translation).norm(), tolerance);
}

TEST(AngleDeg, AgreesWithTheAngleOfTheAxis) {
  for (const double angle_deg : {0.0, 1e-9, 0.5, 90.0, 179.0}) {
    const Matrix3d turned =
        AngleAxisd(angle_deg * kPi / 180, Vector3d::UnitY()).matrix();
    EXPECT_NEAR(AngleDeg(Matrix3d::Identity(), turned), angle_deg,
                1e-12 + 1e-13 * angle_deg);
  }
}

TEST(Align, RecoversASimilarityThatWasApplied) {
  const Similarity expected = SomeSimilarity();
  const std::vector<PosePair> poses = MovedPoses(20, expected);
  for (const AlignmentKind kind :
       {AlignmentKind::kFrame, AlignmentKind::kSimilarity}) {
    const std::optional<Similarity> found = Align(kind, poses);
    ASSERT_TRUE(found);
    ExpectNear(*found, expected, 1e-9);
  }
}

TEST(Align, LeavesPosesThatAreEqualToTheBit) {
  const std::vector<PosePair> poses = MovedPoses(20, Similarity());
  for (const AlignmentKind kind :
       {AlignmentKind::kFrame, AlignmentKind::kSimilarity,
        AlignmentKind::kNone}) {
    const std::optional<Similarity> found = Align(kind, poses);
    ASSERT_TRUE(found);
    ExpectNear(*found, Similarity(), 0);
  }
}

// The sum of squares that AlignCenters minimises.
double SumOfSquares(const std::vector<PosePair>& poses,
                    const Similarity& similarity) {
  double sum = 0;
  for (const PosePair& pose : poses) {
    sum += (pose.center1 - similarity * pose.center2).squaredNorm();
  }
  return sum;
}

TEST(AlignCenters, IsAtTheMinimumOfTheSumOfSquares) {
  std::vector<PosePair> poses = MovedPoses(12, SomeSimilarity());
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 0.5);
  for (PosePair& pose : poses) {
    for (double& x : pose.center1) x += noise(random);
  }
  const Similarity fitted = AlignCenters(poses).value();
  const double least = SumOfSquares(poses, fitted);
  constexpr double kStep = 1e-3;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double step : {-kStep, kStep}) {
      Similarity turned = fitted;
      turned.rotation =
          AngleAxisd(step, Vector3d::Unit(axis)).matrix() * fitted.rotation;
      EXPECT_GT(SumOfSquares(poses, turned), least);
      Similarity moved = fitted;
      moved.translation[axis] += step;
      EXPECT_GT(SumOfSquares(poses, moved), least);
      Similarity scaled = fitted;
      scaled.scale *= 1 + step;
      EXPECT_GT(SumOfSquares(poses, scaled), least);
    }
  }
}

TEST(AlignCenters, NeedsThreeCentersThatAreNotOnALine) {
  EXPECT_FALSE(AlignCenters({}));
  EXPECT_FALSE(AlignCenters(MovedPoses(1, SomeSimilarity())));
  EXPECT_FALSE(AlignCenters(MovedPoses(2, SomeSimilarity())));
  EXPECT_TRUE(AlignCenters(MovedPoses(3, SomeSimilarity())));
  std::vector<PosePair> on_a_line = MovedPoses(5, SomeSimilarity());
  for (size_t n = 0; n < on_a_line.size(); ++n) {
    on_a_line[n].center2 = static_cast<double>(n) * Vector3d(1, 2, 3);
  }
  EXPECT_FALSE(AlignCenters(on_a_line));
}

TEST(AlignFrames, OfOneImagePutsItWhereItIsAndKeepsTheScale) {
  const std::vector<PosePair> poses = MovedPoses(1, SomeSimilarity());
  const Similarity found = AlignFrames(poses).value();
  EXPECT_EQ(found.scale, 1);
  EXPECT_LE((found.rotation - SomeSimilarity().rotation).norm(), 1e-14);
  EXPECT_LE((found * poses[0].center2 - poses[0].center1).norm(), 1e-13);
}

TEST(AlignFrames, NeedsImagesWhoseRotationsHaveAMean) {
  EXPECT_FALSE(AlignFrames({}));
  // Opposite half turns, one about each axis and none: they sum to zero.
  std::vector<PosePair> poses(4);
  for (int axis = 0; axis < 3; ++axis) {
    poses[axis].cam_from_world2_rotation =
        -Matrix3d::Identity() +
        2 * Vector3d::Unit(axis) * Vector3d::Unit(axis).transpose();
  }
  EXPECT_FALSE(AlignFrames(poses));
}

TEST(AlignFrames, MakesCentroidAndRadiusEqual) {
  std::vector<PosePair> poses = MovedPoses(9, SomeSimilarity());
  for (size_t n = 0; n < poses.size(); ++n) {
    poses[n].center2.x() += std::sin(static_cast<double>(n));
  }
  const Similarity found = AlignFrames(poses).value();
  std::vector<PosePair> aligned = poses;
  Vector3d shift = Vector3d::Zero();
  for (PosePair& pose : aligned) {
    shift += found * pose.center2 - pose.center1;
    pose.center1 = found * pose.center2;
  }
  EXPECT_LE(shift.norm(), 1e-11);
  EXPECT_NEAR(SceneRadius(aligned), SceneRadius(poses), 1e-12);
}

TEST(AlignFrames, IsThatOfTheOthersWhereACameraRunsAway) {
  const Similarity similarity = SomeSimilarity();
  std::vector<PosePair> poses = MovedPoses(12, similarity);
  for (PosePair& pose : poses) {
    pose.distance1 = 10;
    pose.distance2 = 10 / similarity.scale;
  }
  poses[4].center2 *= 1e7;
  poses[4].distance2 *= 1e7;
  poses[4].cam_from_world2_rotation =
      Matrix3d(AngleAxisd(2, Vector3d::UnitZ())) *
      poses[4].cam_from_world2_rotation;
  ExpectNear(AlignFrames(poses).value(), similarity, 1e-12);
  std::vector<PosePair> others = poses;
  others.erase(others.begin() + 4);
  EXPECT_EQ(SceneRadius(HeldPoses(poses)), SceneRadius(others));
}

SceneOptions RigScene() {
  SceneOptions options = SceneOf(5, 50, 6, 1);
  options.sensors_per_rig = 2;
  return options;
}

TEST(TransformModel, LeavesEveryPixelErrorWhereItIs) {
  const Model model = SynthesizeScene(RigScene()).model;
  const Model moved = TransformModel(model, SomeSimilarity());
  ValidateModel(moved);
  const std::vector<double> before = PixelErrors(model);
  const std::vector<double> after = PixelErrors(moved);
  ASSERT_EQ(after.size(), before.size());
  for (size_t n = 0; n < before.size(); ++n) {
    EXPECT_NEAR(after[n], before[n], 1e-8);
  }
}

TEST(TransformModel, MovesCentersAndPointsAsPoints) {
  const Model model = SynthesizeScene(RigScene()).model;
  const Similarity similarity = SomeSimilarity();
  const Model moved = TransformModel(model, similarity);
  const std::vector<ImageGeometry> before = ImageGeometries(model);
  const std::vector<ImageGeometry> after = ImageGeometries(moved);
  const auto center = [](const ImageGeometry& image) -> Vector3d {
    return -image.cam_from_world.rotation.transpose() *
           image.cam_from_world.translation;
  };
  for (size_t n = 0; n < before.size(); ++n) {
    EXPECT_LE((center(after[n]) - similarity * center(before[n])).norm(),
              1e-12);
  }
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    EXPECT_EQ(moved.points3D[k].xyz, similarity * model.points3D[k].xyz);
  }
}

TEST(TransformModel, KeepsAllBitsUnderTheIdentityAndNaNUnderAnything) {
  Model model = SynthesizeScene(RigScene()).model;
  model.frames[1].rig_from_world.translation.setConstant(
      std::numeric_limits<double>::quiet_NaN());
  EXPECT_THAT(TransformModel(model, Similarity()), IsModel(model));
  const Model moved = TransformModel(model, SomeSimilarity());
  EXPECT_TRUE(moved.frames[1].rig_from_world.translation.array().isNaN().all());
  ValidateModel(moved);
}

}  // namespace
}  // namespace krot::internal
