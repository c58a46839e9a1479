// A model that no estimate improves, as one that took no part would suffer.

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/camera/camera_model.h"
#include "krot/convert/reprojection.h"
#include "krot/model.h"
#include "krot/pipeline/solve_model.h"
#include "krot/synthetic/scene.h"
#include "tests/convert/lens_model.h"
#include "tests/testing/model_matchers.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

constexpr double kNoBound = std::numeric_limits<double>::infinity();
constexpr double kBaseline = 1e-3;

Eigen::Vector2d PixelOf(const Model& model, const Image& image,
                        const Eigen::Vector3d& xyz) {
  const Camera& camera = model.cameras[0];
  return ProjectPoint(camera, image.cam_from_world.Transform() * xyz).value();
}

// Image 1 stands a thousandth beside image 0, and both see a point right in
// front of them, without error. It has but two observations: where three are
// asked for it takes no part, and whoever moves one of the two images against
// the other moves it by hundreds of pixels.
Model ModelThatAnyStepSpoils() {
  Model model = MakeLensModel({});
  Image& first = model.images[0];
  Image& second = model.images[1];
  const Eigen::Matrix3d R = second.cam_from_world.Rotation();
  const Eigen::Vector3d centre = Center(first.cam_from_world.Transform()) +
                                 Eigen::Vector3d(kBaseline, 0, 0);
  std::vector<Eigen::Vector2d> noise;
  for (const Point3D& point : model.points3D) {
    const Point2D& old = second.points2D[point.id - 1];
    noise.push_back(Eigen::Vector2d(old.x, old.y) -
                    PixelOf(model, second, point.xyz));
  }
  second.cam_from_world.translation = -(R * centre);
  for (const Point3D& point : model.points3D) {
    const Eigen::Vector2d pixel =
        PixelOf(model, second, point.xyz) + noise[point.id - 1];
    second.points2D[point.id - 1] = {pixel.x(), pixel.y(), point.id};
  }

  Point3D near;
  near.id = model.points3D.size() + 1;
  near.xyz = centre + Eigen::Vector3d(0, 0, 2 * kBaseline);
  near.track_begin = model.track_elements.size();
  for (Image* image : {&first, &second}) {
    const Eigen::Vector2d pixel = PixelOf(model, *image, near.xyz);
    model.track_elements.push_back(
        {image->id, static_cast<uint32_t>(image->points2D.size())});
    image->points2D.push_back({pixel.x(), pixel.y(), near.id});
  }
  near.track_end = model.track_elements.size();
  model.points3D.push_back(near);
  UseTrivialRigs(&model);
  return model;
}

class GivenBackIn : public ::testing::TestWithParam<double> {};

INSTANTIATE_TEST_SUITE_P(Norms, GivenBackIn, ::testing::Values(1, 2, kNoBound));

TEST_P(GivenBackIn, IsTheInputAndAllNumbersSpeakOfIt) {
  const Model model = ModelThatAnyStepSpoils();
  SolveModelOptions options;
  options.norm = {GetParam()};
  options.problem.min_track_length = 3;
  const SolveModelResult result = SolveModel(model, options);
  const SolveSummary& summary = result.summary;
  ASSERT_TRUE(summary.is_given_back);
  Ignoring stored_errors;
  stored_errors.point_errors = true;
  EXPECT_THAT(result.model, IsModel(model, stored_errors));
  EXPECT_EQ(summary.pixel_error_after.max, summary.pixel_error_before.max);

  const std::vector<double> errors = PixelErrors(model, -1, Norm{GetParam()});
  const double largest = *std::max_element(errors.begin(), errors.end());
  EXPECT_NEAR(summary.cost_final, largest, 1e-9);
  ASSERT_TRUE(summary.is_certified);
  EXPECT_LT(*summary.lower_bound, largest);
  EXPECT_NEAR(*summary.relative_gap, 1 - *summary.lower_bound / largest, 1e-9);
  EXPECT_EQ(summary.termination, SolveTermination::kUnproved);
  ASSERT_FALSE(summary.support.empty());
  for (const SupportObservation& o : summary.support) {
    const uint64_t element = 3 * (o.point3D_id - 1) + o.image_id - 1;
    EXPECT_NEAR(o.error_px, errors[element], 1e-9);
  }
}

TEST_P(GivenBackIn, IsNotWhatCanBeImproved) {
  const Model model = MakeLensModel({});
  SolveModelOptions options;
  options.norm = {GetParam()};
  const SolveModelResult result = SolveModel(model, options);
  EXPECT_FALSE(result.summary.is_given_back);
  const auto largest = [&](const Model& m) {
    const std::vector<double> errors = PixelErrors(m, -1, options.norm);
    return *std::max_element(errors.begin(), errors.end());
  };
  EXPECT_LT(largest(result.model), largest(model));
}

// Every image sees every point at its first 2D point.
Model ModelThatCollapses() {
  Model model = MakeLensModel({});
  for (Image& image : model.images) {
    const Point2D first = image.points2D.front();
    for (Point2D& point : image.points2D) {
      point.x = first.x;
      point.y = first.y;
    }
  }
  return model;
}

TEST(GivenBack, IsAModelWhoseErrorsFallOnlyWhereAllPointsBecomeOne) {
  const Model model = ModelThatCollapses();
  const SolveModelResult result = SolveModel(model, {});
  EXPECT_EQ(result.summary.termination, SolveTermination::kCollapsed);
  EXPECT_TRUE(result.summary.is_given_back);
  EXPECT_TRUE(result.summary.collapse.is_in_one_place);
  Ignoring stored_errors;
  stored_errors.point_errors = true;
  EXPECT_THAT(result.model, IsModel(model, stored_errors));
  EXPECT_EQ(result.summary.pixel_error_after.max,
            result.summary.pixel_error_before.max);
}

TEST(GivenBack, IsNotAModelWithoutNoiseWhoseErrorsFallToZero) {
  SceneOptions scene = SceneOf(8, 100);
  scene.start_translation_noise = 0.05;
  scene.start_point_noise = 0.05;
  const SolveSummary summary =
      SolveModel(SynthesizeScene(scene).model, {}).summary;
  EXPECT_GT(summary.cost_initial, 10);
  EXPECT_EQ(summary.termination, SolveTermination::kZeroCost);
  EXPECT_FALSE(summary.collapse.Any());
  EXPECT_FALSE(summary.is_underdetermined);
  EXPECT_FALSE(summary.is_given_back);
}

TEST(IsUnderdetermined, WhereObservationsAreNoMoreThanWhatTheyDetermine) {
  // 4 numbers of a point against 6 of two frames, 3 of each point, and 4 that
  // are free in any case.
  for (const int num_points : {1, 2, 3}) {
    SceneOptions scene = SceneOf(2, num_points, 2, 1);
    const SolveSummary summary =
        SolveModel(SynthesizeScene(scene).model, {}).summary;
    ASSERT_EQ(summary.num_observations, 2 * num_points);
    EXPECT_EQ(summary.is_underdetermined, num_points <= 2);
  }
}

// Of the truth, which least squares would hardly improve. Half of all
// observations have a twin up to two pixels away.
Model ModelOfTwins() {
  SceneOptions scene = SceneOf(8, 100, 6, 0.7);
  scene.duplicate_ratio = 0.5;
  return SynthesizeScene(scene).ground_truth;
}

TEST(GivenBack, IsNotAModelWhoseTwinsRiseThatWereLeftOut) {
  const Model model = ModelOfTwins();
  SolveModelOptions options;
  options.problem.same_image = SameImage::kClosest;
  const SolveModelResult result = SolveModel(model, options);
  const SolveSummary& summary = result.summary;
  const double largest_before = Summarize(PixelErrors(model)).max;
  const double largest_after = Summarize(PixelErrors(result.model)).max;
  ASSERT_GT(largest_after, largest_before);  // a twin's, or this shows nothing
  EXPECT_FALSE(summary.is_given_back);
  EXPECT_EQ(summary.largest_twin_error, largest_after);
  EXPECT_LT(summary.cost_final, summary.cost_initial);
  EXPECT_EQ(summary.pixel_error_after.max, summary.cost_final);
  EXPECT_EQ(summary.pixel_error_after.count, summary.num_observations);
}

}  // namespace
}  // namespace krot::internal
