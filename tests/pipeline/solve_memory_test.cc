#include "krot/pipeline/stages.h"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <vector>

#include <gtest/gtest.h>

#include "krot/synthetic/scene.h"
#include "tests/testing/sanitizer.h"

namespace krot::internal {
namespace {

int64_t Estimate(const Model& model, SolveMethod method,
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
    const double estimated =
        static_cast<double>(Estimate(MakeModel(kLarge), c.method, c.init) -
                            Estimate(MakeModel(kSmall), c.method, c.init));
    EXPECT_NEAR(estimated, measured[n], 0.25 * measured[n]) << n;
  }
}

TEST(EstimateSolveMemory, CountsEveryObservationOnTheWayToAStart) {
  const Model model = MakeModel(20000);
  EXPECT_GT(Estimate(model, SolveMethod::kResInt, SolveInit::kFeasible),
            Estimate(model, SolveMethod::kJoint));
  EXPECT_GE(Estimate(model, SolveMethod::kJoint),
            Estimate(model, SolveMethod::kResInt));
}

}  // namespace
}  // namespace krot::internal
