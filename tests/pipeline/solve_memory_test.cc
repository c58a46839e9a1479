#include "krot/pipeline/solve_memory.h"

#include <gtest/gtest.h>

#include "krot/bridge/bridge.h"
#include "krot/synthetic/scene.h"

namespace krot {
namespace {

TEST(EstimateSolveBytes, GrowsWithTheObservations) {
  SceneOptions scene;
  scene.num_points = 20000;
  const Model model = SynthesizeScene(scene).model;
  const KnownRotationProblem problem = BuildProblem(model, {}).problem;
  const int64_t base =
      EstimateSolveBytes(Model(), {}, SolveMethod::kResInt, Norm::L2());
  const int64_t bytes =
      EstimateSolveBytes(model, problem, SolveMethod::kResInt, Norm::L2()) -
      base;
  const int64_t num_observations =
      static_cast<int64_t>(model.track_elements.size());
  EXPECT_GT(bytes, 100 * num_observations);
  EXPECT_LT(bytes, 1000 * num_observations);
}

TEST(EstimateSolveBytes, CountsTheJointSolver) {
  const Model model = SynthesizeScene({}).model;
  const KnownRotationProblem problem = BuildProblem(model, {}).problem;
  EXPECT_GT(
      EstimateSolveBytes(model, problem, SolveMethod::kAuto, Norm::L2()),
      EstimateSolveBytes(model, problem, SolveMethod::kResInt, Norm::L2()));
}

}  // namespace
}  // namespace krot
