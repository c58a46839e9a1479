#include "tools/krot/solve_progress.h"

#include <algorithm>
#include <iostream>
#include <optional>
#include <streambuf>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace krot {
namespace {

using ::testing::HasSubstr;

std::string ErrorTextOf(const SolveProgress::Style style,
                        const LogOptions& log) {
  testing::internal::CaptureStderr();
  SolveProgress progress(log, {1e-4, 100, 1e-4}, style);
  progress.Update(1, Sweep{8.0, 0.5});
  progress.Update(2, Sweep{7.92, 1.0});  // a gain of 1e-2: half way to 1e-4
  // A gap of 1e-2: half way to 1e-4.
  progress.Update(1, JointIteration{7.5, {}, 1e-2, 1.5, {}});
  progress.Update(2, JointIteration{7.0, 6.9999, 1e-3, 2.0, {}});
  progress.Finish();
  return testing::internal::GetCapturedStderr();
}

TEST(SolveProgress, PrintsOneLinePerStepWhereNoTerminalIs) {
  EXPECT_EQ(ErrorTextOf(SolveProgress::Style::kLines, {}),
            "sweep 1: cost 8.000000 px, 0.50 s\n"
            "sweep 2: cost 7.920000 px, 1.00 s\n"
            "iteration 1: cost 7.500000 px, proved bound not yet known, "
            "estimated gap 1.0e-02, 1.50 s\n"
            "iteration 2: cost 7.000000 px, proved bound 6.999900 px, "
            "estimated gap 1.0e-03, 2.00 s\n");
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
  SolveProgress progress({}, {1e-4, 100, 1e-4}, SolveProgress::Style::kLines);
  progress.Update(1, Sweep{8.0, 0.5});
  progress.Update(2, Sweep{7.5, 1.0});
  std::cerr.rdbuf(usual);
  EXPECT_THAT(pieces.all,
              ::testing::ElementsAre("sweep 1: cost 8.000000 px, 0.50 s\n",
                                     "sweep 2: cost 7.500000 px, 1.00 s\n"));
}

TEST(SolveProgress, SaysWhatAStartIsToMeet) {
  testing::internal::CaptureStderr();
  SolveProgress progress({}, {1e-4, 100, 1e-4}, SolveProgress::Style::kLines);
  progress.Update(1, JointIteration{{}, {}, {}, 0.25, 100.0});
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "iteration 1: looking for a start below 100.000000 px, 0.25 s\n");
}

TEST(SolveProgress, RewritesOneLineWithABarOnATerminal) {
  const std::string text = ErrorTextOf(SolveProgress::Style::kBar, {});
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 2);  // two stages
  EXPECT_EQ(std::count(text.begin(), text.end(), '\r'), 4);
  EXPECT_THAT(text, HasSubstr("[###############...............] sweep 2: cost "
                              "7.920000 px, 1.00 s"));
  EXPECT_THAT(text,
              HasSubstr("[###############...............] iteration 1: "));
  EXPECT_THAT(text,
              HasSubstr("[##############################] iteration 2: "));
}

// One sweep is all there is.
TEST(SolveProgress, FillsTheBarWhenPointsAloneAreSolved) {
  testing::internal::CaptureStderr();
  SolveProgress progress({}, SolveProgress::GoalsOf(PointsOnly({})),
                         SolveProgress::Style::kBar);
  progress.Update(1, Sweep{8.0, 0.5});
  progress.Finish();
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("[##############################] sweep 1: "));
}

TEST(SolveProgress, IsSilentAtLogLevelZero) {
  LogOptions quiet;
  quiet.level = 0;
  EXPECT_EQ(ErrorTextOf(SolveProgress::Style::kLines, quiet), "");
  EXPECT_EQ(ErrorTextOf(SolveProgress::Style::kBar, quiet), "");
}

}  // namespace
}  // namespace krot
