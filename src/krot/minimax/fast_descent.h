#pragma once

#include "krot/minimax/norm.h"

namespace krot {

// Which means the Fast Descent Method uses; the optimum sought is the same.
enum class FastDescentSettings {
  kPaper,  // Algorithms 2-4 to the letter
  kFast,
};

struct FastDescentOptions {
  FastDescentSettings settings = FastDescentSettings::kFast;
  // The paper's thresholds; `kPaper` only, see docs/cli.md.
  double stationarity_tolerance = 1e-8;  // eps_0 >= 0, norm of the MEB centre
  double step_tolerance = 1e-6;          // eps_1 > 0, units of x
  double slope_probe = 1e-8;             // eps_2 > 0, units of x
  double active_tolerance = 1e-2;        // >= 0, relative to the cost
  double max_step = 10;                  // > 0, units of x
  int max_iterations = 100;              // >= 1
};

}  // namespace krot
