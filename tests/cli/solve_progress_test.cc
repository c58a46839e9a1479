#include "tools/sweep_progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace krot {
namespace {

using ::testing::HasSubstr;

std::string ErrorTextOf(const SweepProgress::Style style,
                        const LogOptions& log) {
  testing::internal::CaptureStderr();
  SweepProgress progress(log, 1e-4, 100, style);
  progress.Update(1, {8.0, 0.5});
  progress.Update(2, {7.92, 1.0});  // a gain of 1e-2: half way to 1e-4
  progress.Finish();
  return testing::internal::GetCapturedStderr();
}

TEST(SweepProgress, PrintsOneLinePerSweepWhereNoTerminalIs) {
  EXPECT_EQ(ErrorTextOf(SweepProgress::Style::kLines, {}),
            "sweep 1: cost 8.000000 px, 0.50 s\n"
            "sweep 2: cost 7.920000 px, 1.00 s\n");
}

TEST(SweepProgress, RewritesOneLineWithABarOnATerminal) {
  const std::string text = ErrorTextOf(SweepProgress::Style::kBar, {});
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\r'), 2);
  EXPECT_THAT(text, HasSubstr("[###############...............] sweep 2: cost "
                              "7.920000 px, 1.00 s"));
}

TEST(SweepProgress, IsSilentAtLogLevelZero) {
  LogOptions quiet;
  quiet.level = 0;
  EXPECT_EQ(ErrorTextOf(SweepProgress::Style::kLines, quiet), "");
  EXPECT_EQ(ErrorTextOf(SweepProgress::Style::kBar, quiet), "");
}

}  // namespace
}  // namespace krot
