#pragma once

#include <array>
#include <optional>

#include "krot/base/context.h"
#include "krot/bridge/reprojection.h"
#include "krot/joint/working_set.h"
#include "krot/tolerance/tolerance_problem.h"

namespace krot {

// One end of an interval that estimates reach.
struct BoxEnd {
  double reached = 0;            // by an estimate that was met
  std::optional<double> proved;  // no estimate lies beyond; none: not bounded
};

// Smallest and largest value of each coordinate of a position, over all
// estimates of a ToleranceProblem; scene units.
struct PositionBox {
  std::array<BoxEnd, 3> low;
  std::array<BoxEnd, 3> high;
  int64_t num_programmes = 0;  // that were solved
};

// Finds them by working sets: an end that is proved on some of the observations
// is one for all, and it is reached where the other points fit in, too
// (docs/method/outliers.md, "What the data allow"). Ends agree to `tolerance`
// of the way from the centre, unless lenses take more. `target` has any
// direction.
PositionBox FindBox(const ToleranceProblem& problem, const Pull& target,
                    double tolerance, const Context& context);

}  // namespace krot
