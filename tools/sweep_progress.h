#pragma once

#include <optional>

#include "krot/solver/res_int.h"
#include "tools/log.h"

namespace krot {

// Tells the user that a solve is alive: on a terminal one line with a bar
// that rewrites itself, otherwise one line per sweep.
class SweepProgress {
 public:
  // `sweep_tolerance` and `max_sweeps` as in ResIntOptions: the bar fills as
  // the gain of a sweep falls to the one or the count rises to the other.
  SweepProgress(const LogOptions& log, double sweep_tolerance, int max_sweeps);

  void Update(int sweep, const Sweep& state);

  // Ends the line of the bar.
  void Finish();

 private:
  double Fraction(int sweep, double cost);

  LogOptions log_;
  double sweep_tolerance_;
  int max_sweeps_;
  bool is_terminal_;
  bool line_is_open_ = false;
  std::optional<double> last_cost_;
  double fraction_ = 0;  // of the bar; never falls
};

}  // namespace krot
