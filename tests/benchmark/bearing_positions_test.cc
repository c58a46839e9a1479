#include "tools/benchmark/rivals/bearing_positions.h"

#include <cmath>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "krot/analysis/model_comparison.h"
#include "krot/convert/build_problem.h"
#include "krot/synthetic/scene.h"
#include "tests/testing/scene_of.h"

namespace krot::internal {
namespace {

TEST(PositionByBearings, FindsTheCamerasOfASceneWithoutNoise) {
  SceneOptions options = SceneOf(10, 300);
  options.camera_model_id = 1;
  const Model truth = SynthesizeScene(options).ground_truth;
  const BuiltProblem built = BuildProblem(truth, {});
  const Estimate estimate = PositionByBearings(built.problem, {});
  std::vector<PosePair> poses;
  for (const View& view : built.problem.views) {
    const auto centre = [&](const Estimate& x) -> Eigen::Vector3d {
      return -view.cam_from_world_rotation.transpose() *
             view.cam_from_rig_rotation * x.translations[view.frame];
    };
    PosePair pose;
    pose.center1 = centre(built.start);
    pose.center2 = centre(estimate);
    poses.push_back(pose);
  }
  const std::optional<Similarity> fit = AlignCenters(poses);
  ASSERT_TRUE(fit);
  for (const PosePair& pose : poses) {
    EXPECT_LT((*fit * pose.center2 - pose.center1).norm(),
              0.01 * SceneRadius(poses));
  }
}

}  // namespace
}  // namespace krot::internal
