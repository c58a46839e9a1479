#include "krot/pipeline/solve_memory.h"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <vector>

#include <gtest/gtest.h>

#include "krot/synthetic/scene.h"
#include "tests/testing/sanitizer.h"

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
  scene.pixel_noise = 0.5;
  return SynthesizeScene(scene).model;
}

// The largest resident set of a process that solves the scene, bytes.
int64_t PeakBytes(int num_points, SolveMethod method, SolveInit init) {
  const pid_t child = fork();
  if (child == 0) {
    SolveModelOptions options;
    options.method = method;
    options.init = init;
    SolveModel(MakeModel(num_points), options, {1});
    _exit(0);
  }
  int status = -1;
  rusage usage = {};
  wait4(child, &status, 0, &usage);
  EXPECT_EQ(status, 0);
  return 1024 * static_cast<int64_t>(usage.ru_maxrss);
}

// Of one size less another, so that what a process takes without a model does
// not count.
TEST(EstimateSolveMemory, GrowsAsThePeakOfAProcessDoes) {
  if (kIsSanitized) GTEST_SKIP() << "a sanitizer keeps back what is freed";
  constexpr int kSmall = 2000;
  constexpr int kLarge = 20000;
  struct Case {
    SolveMethod method;
    SolveInit init;
  };
  const std::vector<Case> cases = {{SolveMethod::kResInt, SolveInit::kModel},
                                   {SolveMethod::kAuto, SolveInit::kModel},
                                   {SolveMethod::kJoint, SolveInit::kFeasible}};
  // First, while this process holds nothing that its children would inherit.
  std::vector<double> measured;
  for (const Case& c : cases) {
    measured.push_back(
        static_cast<double>(PeakBytes(kLarge, c.method, c.init) -
                            PeakBytes(kSmall, c.method, c.init)));
  }
  for (size_t n = 0; n < cases.size(); ++n) {
    const Case& c = cases[n];
    const double estimated = static_cast<double>(
        Estimate(MakeModel(kLarge), c.method, c.init).likely -
        Estimate(MakeModel(kSmall), c.method, c.init).likely);
    EXPECT_NEAR(estimated, measured[n], 0.3 * measured[n]) << n;
  }
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
    // The finish of kAuto looks at all observations in any case.
    EXPECT_GT(memory.at_most, method == SolveMethod::kJoint
                                  ? 3 * memory.likely / 2
                                  : memory.likely);
  }
}

TEST(EstimateSolveMemory, CountsEveryObservationOnTheWayToAStart) {
  const Model model = MakeModel(20000);
  const SolveMemory memory =
      Estimate(model, SolveMethod::kResInt, SolveInit::kFeasible);
  EXPECT_GT(memory.likely, Estimate(model, SolveMethod::kJoint).likely);
  EXPECT_EQ(memory.at_most, Estimate(model, SolveMethod::kJoint).at_most);
}

}  // namespace
}  // namespace krot
