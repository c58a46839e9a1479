
#include <gtest/gtest.h>

#include "krot/convert/build_problem.h"
#include "krot/convert/reprojection.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

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

}  // namespace
}  // namespace krot::internal
