#pragma once

#include <array>
#include <optional>

#include "krot/base/context.h"
#include "krot/bridge/reprojection.h"
#include "krot/joint/working_set.h"
#include "krot/tolerance/tolerance_problem.h"

namespace krot {

// One end of the interval in which a coordinate may be.
struct BoxEnd {
  double reached = 0;            // by an estimate that was found
  std::optional<double> proved;  // no estimate is beyond it; none: no bound
};

// Smallest and largest value of each coordinate of a position, over all
// estimates of a ToleranceProblem; scene units.
struct PositionBox {
  std::array<BoxEnd, 3> low;
  std::array<BoxEnd, 3> high;
  int64_t num_programmes = 0;  // that were solved
};

// Finds the box by working sets: an end that is proved with some observations
// holds for all, and it is reached if the other points fit in, too
// (docs/method/outliers.md, "What the data allow"). The reached and the proved
// end agree to `tolerance`, relative to the way from the centre, unless lenses
// prevent it. The direction of `target` does not matter.
PositionBox FindBox(const ToleranceProblem& problem, const Pull& target,
                    double tolerance, const Context& context);

}  // namespace krot
