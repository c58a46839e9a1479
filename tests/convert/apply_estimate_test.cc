#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include "krot/camera/camera_model.h"
#include "krot/convert/build_problem.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/problem/cost.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

Model NoisyModel(int sensors_per_rig, bool has_rigs) {
  SceneOptions options = SceneOf(8, 100, 6, 1);
  options.camera_model_id = FindCameraModel("PINHOLE")->id;
  options.sensors_per_rig = sensors_per_rig;
  options.has_rigs = has_rigs;
  return SynthesizeScene(options).model;
}

Estimate Moved(Estimate estimate) {
  for (Eigen::Vector3d& t : estimate.translations) t.x() += 1e-3;
  for (Eigen::Vector3d& point : estimate.points) point.y() += 1e-3;
  return estimate;
}

class ApplyEstimateToModel : public ::testing::TestWithParam<int> {
 protected:
  // Sensors per rig; 0: a legacy model.
  const Model model_ = NoisyModel(std::max(GetParam(), 1), GetParam() > 0);
  const BuiltProblem built_ = BuildProblem(model_, {});
};

TEST_P(ApplyEstimateToModel, OfTheStartChangesNoBit) {
  EXPECT_THAT(ApplyEstimate(model_, built_, built_.start), IsModel(model_));
}

TEST_P(ApplyEstimateToModel, ChangesNothingButTranslationsAndPoints) {
  const Model result = ApplyEstimate(model_, built_, Moved(built_.start));
  EXPECT_THAT(result, IsModel(model_, Ignoring{true, true, false}));
  EXPECT_THAT(result, ::testing::Not(IsModel(model_)));
}

TEST_P(ApplyEstimateToModel, GivesTheModelTheCostOfTheEstimate) {
  const Estimate moved = Moved(built_.start);
  const Model result = ApplyEstimate(model_, built_, moved);
  const double cost = Cost(built_.problem, moved, Norm::L2(), 1);
  EXPECT_GT(cost, Cost(built_.problem, built_.start, Norm::L2(), 1));
  EXPECT_NEAR(Summarize(PixelErrors(result)).max, cost, 1e-9);
  EXPECT_EQ(BuildProblem(result, {}).start.points, moved.points);
  EXPECT_EQ(BuildProblem(result, {}).start.translations, moved.translations);
}

TEST_P(ApplyEstimateToModel, MakesImagesAgreeWithTheirFrames) {
  const Model result = ApplyEstimate(model_, built_, Moved(built_.start));
  const std::vector<ImageGeometry> geometries = ImageGeometries(result);
  for (size_t n = 0; n < result.images.size(); ++n) {
    const Pose& pose = result.images[n].cam_from_world;
    EXPECT_NEAR(
        (pose.translation - geometries[n].cam_from_world.translation).norm(), 0,
        1e-15);
    EXPECT_NEAR(
        (pose.Rotation() - geometries[n].cam_from_world.rotation).norm(), 0,
        1e-14);
  }
}

INSTANTIATE_TEST_SUITE_P(LegacyAndRigs, ApplyEstimateToModel,
                         ::testing::Values(0, 1, 3));

TEST(ApplyEstimate, CorrectsImagesThatContradictTheirFrames) {
  const Model consistent = NoisyModel(2, true);
  Model model = consistent;
  for (Image& image : model.images) image.cam_from_world = Pose();
  const BuiltProblem built = BuildProblem(model, {});
  const Model result = ApplyEstimate(model, built, built.start);
  for (size_t n = 0; n < result.images.size(); ++n) {
    const Pose& found = result.images[n].cam_from_world;
    const Pose& expected = consistent.images[n].cam_from_world;
    EXPECT_NEAR((found.Rotation() - expected.Rotation()).norm(), 0, 1e-14);
    EXPECT_NEAR((found.translation - expected.translation).norm(), 0, 1e-14);
  }
}

TEST(ApplyEstimate, LeavesFramesAndPointsOutsideTheProblemAlone) {
  Model model = NoisyModel(1, false);
  model.frames[2].rig_from_world.translation.z() = std::nan("");
  const BuiltProblem built = BuildProblem(model, {/*min_track_length=*/6, 1});
  ASSERT_LT(built.point_of.size(), model.points3D.size());
  const Model result = ApplyEstimate(model, built, Moved(built.start));
  std::vector<char> is_optimised(model.points3D.size(), false);
  for (const int32_t k : built.point_of) is_optimised[k] = true;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    EXPECT_EQ(result.points3D[k].xyz == model.points3D[k].xyz,
              !is_optimised[k]);
  }
  EXPECT_EQ(result.images[2].cam_from_world.translation,
            model.images[2].cam_from_world.translation);
  EXPECT_EQ(result.frames[2].rig_from_world.translation.x(),
            model.frames[2].rig_from_world.translation.x());
}

TEST(ApplyEstimate, RefusesAnEstimateOfAnotherSize) {
  const Model model = NoisyModel(1, true);
  const BuiltProblem built = BuildProblem(model, {});
  Estimate estimate = built.start;
  estimate.points.pop_back();
  EXPECT_THROW(ApplyEstimate(model, built, estimate), std::invalid_argument);
  estimate = built.start;
  estimate.translations.emplace_back();
  EXPECT_THROW(ApplyEstimate(model, built, estimate), std::invalid_argument);
}

Ray RayThrough(const Vector3d& centre, const Vector3d& point) {
  return {centre, (point - centre).normalized()};
}

TEST(RetriangulateMidpoint, FindsThePointThatRaysMeetIn) {
  const Vector3d point(1, 2, 8);
  const auto found = RetriangulateMidpoint({RayThrough({0, 0, 0}, point),
                                            RayThrough({1, 0, 0}, point),
                                            RayThrough({0, 1, 1}, point)});
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR((*found - point).norm(), 0, 1e-13);
}

TEST(RetriangulateMidpoint, OfTwoSkewRaysIsMidwayBetweenThem) {
  // Along x at z = 1 and along y at z = 3.
  const auto found =
      RetriangulateMidpoint({{{-5, 7, 1}, {1, 0, 0}}, {{4, 9, 3}, {0, 1, 0}}});
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR((*found - Vector3d(4, 7, 2)).norm(), 0, 1e-13);
}

TEST(RetriangulateMidpoint, LosesNoDigitsFarFromTheOrigin) {
  const Vector3d offset(5e6, -4e6, 3e6);
  const Vector3d point = Vector3d(1, 2, 8) + offset;
  const auto found =
      RetriangulateMidpoint({RayThrough(Vector3d(0, 0, 0) + offset, point),
                             RayThrough(Vector3d(1, 0, 0) + offset, point)});
  ASSERT_TRUE(found.has_value());
  // The spacing of doubles at 5e6 is 9e-10.
  EXPECT_NEAR((*found - point).norm(), 0, 2e-9);
}

TEST(RetriangulateMidpoint, OfParallelRaysIsNone) {
  const Vector3d direction = Vector3d(0.3, -0.2, 1).normalized();
  EXPECT_FALSE(
      RetriangulateMidpoint({{{0, 0, 0}, direction}, {{1, 0, 0}, direction}})
          .has_value());
}

TEST(RetriangulateMidpoint, OfOneImageTwiceIsNone) {
  const Ray ray = RayThrough({1, 2, 3}, {4, 4, 9});
  EXPECT_FALSE(RetriangulateMidpoint({ray, ray}).has_value());
}

TEST(RetriangulateMidpoint, OfNoRaysIsNone) {
  EXPECT_FALSE(RetriangulateMidpoint({}).has_value());
}

}  // namespace
}  // namespace krot::internal
