#include "tools/sweep_progress.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <string>

#include "krot/report/text_table.h"

namespace krot {

SweepProgress::Style SweepProgress::StyleOfStderr() {
  return isatty(STDERR_FILENO) == 1 ? Style::kBar : Style::kLines;
}

SweepProgress::SweepProgress(const LogOptions& log, double sweep_tolerance,
                             int max_sweeps, Style style)
    : log_(log),
      sweep_tolerance_(sweep_tolerance),
      max_sweeps_(max_sweeps),
      style_(style) {}

void SweepProgress::Update(int sweep, const Sweep& state) {
  if (log_.level < 1) return;
  const std::string words = "sweep " + std::to_string(sweep) + ": cost " +
                            FormatNumber(state.cost, 6) + " px, " +
                            FormatNumber(state.seconds, 2) + " s";
  if (style_ == Style::kLines) {
    LogLine(log_, 1, words);
    return;
  }
  constexpr int kBarWidth = 30;
  const int filled =
      static_cast<int>(std::lround(kBarWidth * Fraction(sweep, state.cost)));
  const std::string bar =
      std::string(filled, '#') + std::string(kBarWidth - filled, '.');
  // Back to the margin; what is left of a longer line is erased.
  std::cerr << "\r[" << bar << "] " << words << "\033[K" << std::flush;
  line_is_open_ = true;
}

void SweepProgress::Finish() {
  if (line_is_open_) std::cerr << std::endl;
  line_is_open_ = false;
}

double SweepProgress::Fraction(int sweep, double cost) {
  double done = static_cast<double>(sweep) / std::max(1, max_sweeps_);
  if (last_cost_.has_value() && *last_cost_ > 0 && sweep_tolerance_ > 0 &&
      sweep_tolerance_ < 1) {
    const double gain = (*last_cost_ - cost) / *last_cost_;
    done = std::max(done, gain <= sweep_tolerance_
                              ? 1.0
                              : std::log(gain) / std::log(sweep_tolerance_));
  }
  last_cost_ = cost;
  fraction_ = std::clamp(done, fraction_, 1.0);
  return fraction_;
}

}  // namespace krot
