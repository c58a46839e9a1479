#include <signal.h>

#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "krot/model.h"
#include "tests/cli/krot_process.h"
#include "tests/cli/scenes.h"

namespace krot::internal {
namespace {

// A solve of some 30 sweeps and 5 seconds; the signal comes after the first.
class Interrupt : public ::testing::Test {
 protected:
  Interrupt() {
    SceneOptions options = SmallScene();
    options.num_frames = 30;
    options.num_points = 8000;
    Save(SynthesizeScene(options).model, folder_ / "model");
    before_ = Load(folder_ / "model");
  }

  // So that a mix of old and new would show.
  Words InPlace(const std::string& command) const {
    return {command,
            "--input_path",
            folder_ / "model",
            "--output_path",
            folder_ / "model",
            "--overwrite",
            "1"};
  }

  Words Arguments() const {
    return InPlace("solver") + Words{"--ResInt.sweep_tolerance",
                                     "0",
                                     "--report_path",
                                     folder_ / "report.json",
                                     "--ResInt.max_sweeps",
                                     "1000000",
                                     "--Solver.settings",
                                     "paper"};
  }

  KrotResult SignalOnTheWayToAStart() const {
    KrotProcess process(InPlace("solver") + Words{"--Solver.init", "feasible",
                                                  "--Solver.method", "joint"});
    process.WaitForErrorText("iteration 1: looking for a start below");
    process.Signal(SIGINT);
    return process.Wait();
  }

  KrotResult SignalAfterFirstSweep(int signal) const {
    KrotProcess process(Arguments());
    process.WaitForErrorText("sweep 1:");
    process.Signal(signal);
    return process.Wait();
  }

  void ExpectNothingChanged() const {
    EXPECT_EQ(FileNames(folder_.path()), Words{"model"});
    EXPECT_THAT(Load(folder_ / "model"), IsModel(before_));
  }

  TempFolder folder_;
  Model before_;
};

TEST_F(Interrupt, FromTheKeyboardEndsWith130AndWritesNothing) {
  const KrotResult result = SignalAfterFirstSweep(SIGINT);
  EXPECT_EQ(result.exit_code, 130);
  EXPECT_THAT(result.err, ::testing::EndsWith("krot solver: interrupted, "
                                              "nothing was written\n"));
  EXPECT_EQ(result.out, "");
  ExpectNothingChanged();
}

TEST_F(Interrupt, ByTerminationDoesTheSame) {
  EXPECT_EQ(SignalAfterFirstSweep(SIGTERM).exit_code, 130);
  ExpectNothingChanged();
}

TEST_F(Interrupt, WritesTheBestEstimateSoFarIfAsked) {
  KrotProcess process(Arguments() + Words{"--write_on_interrupt", "1"});
  process.WaitForErrorText("sweep 1:");
  process.Signal(SIGINT);
  const KrotResult result = process.Wait();
  EXPECT_EQ(result.exit_code, 130);
  EXPECT_THAT(result.err, ::testing::EndsWith(
                              "interrupted; " + (folder_ / "model").string() +
                              " holds the best estimate so far\n"));
  const double before = Summarize(PixelErrors(before_)).max;
  EXPECT_LT(Summarize(PixelErrors(Load(folder_ / "model"))).max, before);
  EXPECT_THAT(ReadBytes(folder_ / "report.json"), HasSubstr("\"interrupted\""));
}

TEST_F(Interrupt, BeforeThereIsAnEstimateWritesNothingEvenIfAsked) {
  for (const auto& [method, words] :
       {std::pair("joint", "iteration 1: looking for a start below"),
        std::pair("auto", "programme: 1 of 2")}) {
    KrotProcess process(InPlace("solver") + Words{"--Solver.init", "feasible",
                                                  "--Solver.method", method,
                                                  "--write_on_interrupt", "1"});
    process.WaitForErrorText(words);
    process.Signal(SIGTERM);
    const KrotResult result = process.Wait();
    EXPECT_EQ(result.exit_code, 130);
    EXPECT_THAT(result.err,
                ::testing::EndsWith("before there was an estimate, nothing was "
                                    "written\n"));
    ExpectNothingChanged();
  }
}

TEST_F(Interrupt, OnTheWayToAStartDoesTheSame) {
  const KrotResult result = SignalOnTheWayToAStart();
  EXPECT_EQ(result.exit_code, 130);
  EXPECT_THAT(result.err, Not(HasSubstr("sweep 1:")));
  ExpectNothingChanged();
}

TEST_F(Interrupt, ByKillLeavesTheOldModel) {
  EXPECT_EQ(SignalAfterFirstSweep(SIGKILL).exit_code, -SIGKILL);
  ExpectNothingChanged();
}

TEST_F(Interrupt, ByKillLeavesACheckpointToWriteOrToGoOnFrom) {
  const auto arguments = [this](const std::string& output) {
    return Words{"solver",         "--input_path",   folder_ / "model",
                 "--output_path",  folder_ / output, "--checkpoint_path",
                 folder_ / "steps"};
  };
  Succeeded(RunKrot(arguments("undisturbed")));
  KrotProcess process(arguments("out"));
  process.WaitForErrorText("iteration 1:");
  process.Signal(SIGKILL);
  EXPECT_EQ(process.Wait().exit_code, -SIGKILL);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));

  EXPECT_EQ(RunKrot(arguments("so_far"), {"--checkpoint_only", "1"}).exit_code,
            130);
  EXPECT_LT(Summarize(PixelErrors(Load(folder_ / "so_far"))).max,
            Summarize(PixelErrors(before_)).max);

  const KrotResult again = Succeeded(RunKrot(arguments("out")));
  EXPECT_THAT(again.err,
              HasSubstr("steps: going on behind 1 step of an earlier run"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "steps"));
  EXPECT_THAT(Load(folder_ / "out"), IsModel(Load(folder_ / "undisturbed")));
}

TEST_F(Interrupt, RefusesACheckpointOfOtherOptions) {
  const Words arguments = {
      "solver",        "--input_path",      folder_ / "model", "--output_path",
      folder_ / "out", "--checkpoint_path", folder_ / "steps"};
  KrotProcess process(arguments);
  process.WaitForErrorText("iteration 1:");
  process.Signal(SIGKILL);
  process.Wait();
  EXPECT_THAT(RunKrot(arguments, {"--Solver.relative_gap", "1e-3"}),
              IsRefused(1, "krot solver", "this checkpoint is of another run"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

// An adjustment of thousands of steps: no tolerance ends it.
class InterruptAdjustment : public Interrupt,
                            public ::testing::WithParamInterface<const char*> {
};

TEST_P(InterruptAdjustment, EndsWith130AndWritesNothing) {
  const std::string ceres = "--BundleAdjustmentCeres.";
  KrotProcess process(
      InPlace("bundle_adjuster") +
      Words{"--report_path", folder_ / "report.json", "--html_path",
            folder_ / "page.html", ceres + "max_num_iterations", "1000000",
            ceres + "function_tolerance", "0", ceres + "gradient_tolerance",
            "0", GetParam(), "1000"});
  process.WaitForErrorText("iteration ");
  process.Signal(SIGINT);
  const KrotResult result = process.Wait();
  EXPECT_EQ(result.exit_code, 130);
  EXPECT_THAT(result.err,
              ::testing::EndsWith("krot bundle_adjuster: interrupted, nothing "
                                  "was written\n"));
  EXPECT_EQ(result.out, "");
  ExpectNothingChanged();
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, InterruptAdjustment,
    ::testing::Values("--BundleAdjustmentCeres.max_linear_solver_iterations",
                      "--BundleAdjustment.max_error"),
    [](const auto& test) { return test.index == 0 ? "Plain" : "Bounded"; });

}  // namespace
}  // namespace krot::internal
