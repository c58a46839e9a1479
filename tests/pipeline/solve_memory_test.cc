#include "krot/pipeline/solve_memory.h"

#include <gtest/gtest.h>

#include "krot/synthetic/scene.h"

namespace krot {
namespace {

SolveMemory Estimate(const Model& model, SolveMethod method,
                     SolveInit init = SolveInit::kModel) {
  SolveSummary summary;
  summary.method = method;
  summary.init = init;
  return EstimateSolveMemory(model, BuildProblem(model, {}), summary);
}

Model MakeModel(int num_points) {
  SceneOptions scene;
  scene.num_points = num_points;
  return SynthesizeScene(scene).model;
}

TEST(EstimateSolveMemory, GrowsWithTheObservations) {
  const Model model = MakeModel(20000);
  const int64_t bytes =
      Estimate(model, SolveMethod::kResInt).likely -
      EstimateSolveMemory(Model(), BuiltProblem(), SolveSummary()).likely;
  const int64_t num_observations =
      static_cast<int64_t>(model.track_elements.size());
  EXPECT_GT(bytes, 100 * num_observations);
  EXPECT_LT(bytes, 1000 * num_observations);
}

TEST(EstimateSolveMemory, IsCertainForSweepsAlone) {
  const SolveMemory memory = Estimate(MakeModel(1000), SolveMethod::kResInt);
  EXPECT_EQ(memory.likely, memory.at_most);
}

TEST(EstimateSolveMemory, CountsAWorkingSetAndAtMostEveryObservation) {
  const Model model = MakeModel(20000);
  for (const SolveMethod method : {SolveMethod::kAuto, SolveMethod::kJoint}) {
    const SolveMemory memory = Estimate(model, method);
    EXPECT_GE(memory.likely, Estimate(model, SolveMethod::kResInt).likely);
    EXPECT_GT(memory.at_most, 3 * memory.likely / 2);
  }
}

TEST(EstimateSolveMemory, CountsEveryObservationOnTheWayToAStart) {
  const Model model = MakeModel(20000);
  const SolveMemory memory =
      Estimate(model, SolveMethod::kResInt, SolveInit::kFeasible);
  EXPECT_EQ(memory.likely, memory.at_most);
  EXPECT_EQ(memory.likely, Estimate(model, SolveMethod::kAuto).at_most);
}

}  // namespace
}  // namespace krot
