#include "tools/krot/solve_progress.h"

#include <algorithm>
#include <chrono>
#include <iostream>
#include <optional>
#include <streambuf>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/krot/log.h"

namespace krot::internal {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

LogOptions AtLevel(int level) {
  LogOptions log;
  log.level = level;
  return log;
}

const SolveProgress::Goals kGoals = {1e-4, 100, 1e-4};

std::string ErrorTextOf(const LogOptions& log) {
  testing::internal::CaptureStderr();
  SolveModelOptions options;
  Context context;
  SolveProgress progress(log, kGoals);
  progress.Follow(&options, &context);
  options.res_int.callback(1, Sweep{8.0, 0.5});
  options.res_int.callback(2, Sweep{7.94, 0.75});
  options.res_int.callback(3, Sweep{7.92, 1.0});
  options.joint.callback(1, JointIteration{7.5, {}, 1e-2, 1.5, {}});
  options.joint.callback(2, JointIteration{7.0, 6.9999, 1e-3, 2.0, {}});
  context.Note("a sentence");
  EndProgress();
  return testing::internal::GetCapturedStderr();
}

TEST(SolveProgress, PrintsTheEndsOfEveryStageWhereNoTerminalIs) {
  EXPECT_EQ(ErrorTextOf(AtLevel(1)),
            "sweep 1: cost 8.0000 px, 0.50 s\n"
            "sweep 3: cost 7.9200 px, 1.00 s\n"
            "iteration 1: cost 7.5000 px, gap ~1.0e-02, 1.50 s\n"
            "iteration 2: cost 7.0000 px, proved 6.9999 px, gap ~1.0e-03, "
            "2.00 s\n"
            "a sentence\n");
}

TEST(SolveProgress, PrintsEveryStepAtLevelTwo) {
  EXPECT_THAT(ErrorTextOf(AtLevel(2)),
              HasSubstr("sweep 1: cost 8.0000 px, 0.50 s\n"
                        "sweep 2: cost 7.9400 px, 0.75 s\n"
                        "sweep 3: cost 7.9200 px, 1.00 s\n"));
}

TEST(ShowProgress, LeavesNoFurtherLinesOfStagesThatComeAgain) {
  testing::internal::CaptureStderr();
  for (int round = 1; round <= 20; ++round) {
    for (const char* const stage : {"a", "b"}) {
      for (const char* const step : {" begins", " ends"}) {
        ShowProgress({}, {stage, stage + std::to_string(round) + step, {}});
      }
    }
  }
  EndProgress();
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "a1 begins\na1 ends\nb1 begins\nb1 ends\nb20 ends\n");
}

TEST(SolveProgress, IsSilentAtLogLevelZero) {
  EXPECT_EQ(ErrorTextOf(AtLevel(0)), "");
}

TEST(SolveProgress, SaysWhatAStartIsToMeet) {
  EXPECT_EQ(SolveProgress({}, kGoals)
                .Describe(1, JointIteration{{}, {}, {}, 0.25, 100.0})
                .words,
            "iteration 1: looking for a start below 100.0000 px, 0.25 s");
}

TEST(SolveProgress, FillsTheBarByDecadesOnTheWayToTheGoal) {
  SolveProgress progress({}, kGoals);
  progress.Describe(1, Sweep{8.0, 0.5});
  // A gain of 1e-2: half way to 1e-4.
  EXPECT_NEAR(*progress.Describe(2, Sweep{7.92, 1.0}).fraction, 0.5, 1e-12);
  EXPECT_NEAR(
      *progress.Describe(1, JointIteration{7.5, {}, 1e-2, 1.5, {}}).fraction,
      0.5, 1e-12);
  EXPECT_EQ(*progress.Describe(2, JointIteration{7.0, 6.9999, 1e-3, 2.0, {}})
                 .fraction,
            1.0);
}

// One sweep is all there is.
TEST(SolveProgress, FillsTheBarWhenPointsAloneAreSolved) {
  SolveProgress progress({}, SolveProgress::GoalsOf(PointsOnly({})));
  EXPECT_EQ(*progress.Describe(1, Sweep{8.0, 0.5}).fraction, 1.0);
}

// What arrives at once.
class Pieces : public std::streambuf {
 public:
  std::vector<std::string> all;

 protected:
  std::streamsize xsputn(const char* text, std::streamsize size) override {
    all.emplace_back(text, size);
    return size;
  }
  int overflow(int letter) override {
    all.emplace_back(1, static_cast<char>(letter));
    return letter;
  }
};

// A signal may come between two pieces, and its sentence begins a line.
TEST(SolveProgress, WritesEveryLineInOnePiece) {
  Pieces pieces;
  std::streambuf* const usual = std::cerr.rdbuf(&pieces);
  {
    SolveProgress progress({}, kGoals);
    ShowProgress({}, progress.Describe(1, Sweep{8.0, 0.5}));
    ShowProgress({}, progress.Describe(2, Sweep{7.5, 1.0}));
    LogLine({}, 1, "a sentence");
  }
  std::cerr.rdbuf(usual);
  EXPECT_THAT(pieces.all,
              ElementsAre("sweep 1: cost 8.0000 px, 0.50 s\n",
                          "sweep 2: cost 7.5000 px, 1.00 s\n", "a sentence\n"));
}

TEST(Phase, SaysWhatItIsOnceItTakesTwoSecondsAndGoesOn) {
  testing::internal::CaptureStderr();
  BeginPhase({}, "reading a");
  BeginPhase({}, "reading b");
  std::this_thread::sleep_for(std::chrono::milliseconds(5500));
  EndProgress();
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_THAT(text, ::testing::MatchesRegex("(reading b \\([2-5] s\\)\n)+"));
  EXPECT_GE(std::count(text.begin(), text.end(), '\n'), 2);
}

TEST(FitProgress, FillsABarBesideTheWords) {
  EXPECT_EQ(FitProgress({"s", "sweep 2: cost 7.92 px", 0.5}, 80),
            "[###############...............] sweep 2: cost 7.92 px");
  EXPECT_EQ(FitProgress({"s", "sweep 2: cost 7.92 px", 1.0}, 36),
            "[###########] sweep 2: cost 7.92 px");
}

TEST(FitProgress, LeavesTheLastColumnFreeAtAnyWidth) {
  const std::string words =
      "iteration 12: cost 3.4756 px, proved 3.4701 px, gap ~1.0e-02, 1.23 s";
  for (int columns = 1; columns < 250; ++columns) {
    for (const std::optional<double> fraction :
         {std::optional<double>(), std::optional<double>(0.3)}) {
      const std::string line = FitProgress({"i", words, fraction}, columns);
      EXPECT_LT(line.size(), columns);
      EXPECT_THAT(line,
                  HasSubstr(words.substr(0, static_cast<size_t>(columns - 1))));
    }
  }
  EXPECT_THAT(FitProgress({"i", words, 0.3}, 80), HasSubstr("] iteration"));
}

TEST(FitProgress, CutsBetweenCharactersAndTakesThemAsWide) {
  EXPECT_EQ(FitProgress({"r", "r\u00e4\u5f71", {}}, 4), "r\u00e4");
  EXPECT_EQ(FitProgress({"r", "r\u00e4\u5f71", {}}, 5), "r\u00e4");
  EXPECT_EQ(FitProgress({"r", "r\u00e4\u5f71", {}}, 6), "r\u00e4\u5f71");
  EXPECT_EQ(FitProgress({"r", "a\033[31m\nb", {}}, 80), "a [31m b");
}

}  // namespace
}  // namespace krot::internal
