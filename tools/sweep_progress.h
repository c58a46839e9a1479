#pragma once

#include <optional>

#include "krot/solver/res_int.h"
#include "tools/log.h"

namespace krot {

// Tells the user on stderr that a solve is alive.
class SweepProgress {
 public:
  enum class Style {
    kBar,   // one line with a bar that rewrites itself
    kLines  // one line per sweep
  };
  // kBar where stderr is a terminal.
  static Style StyleOfStderr();

  // `sweep_tolerance` and `max_sweeps` as in ResIntOptions: the bar fills as
  // the gain of a sweep falls to the one or the count rises to the other.
  SweepProgress(const LogOptions& log, double sweep_tolerance, int max_sweeps,
                Style style = StyleOfStderr());
  ~SweepProgress() { Finish(); }
  SweepProgress(const SweepProgress&) = delete;
  SweepProgress& operator=(const SweepProgress&) = delete;

  void Update(int sweep, const Sweep& state);

  // Ends the line of the bar.
  void Finish();

 private:
  double Fraction(int sweep, double cost);

  LogOptions log_;
  double sweep_tolerance_;
  int max_sweeps_;
  Style style_;
  bool line_is_open_ = false;
  std::optional<double> last_cost_;
  double fraction_ = 0;  // of the bar; never falls
};

}  // namespace krot
