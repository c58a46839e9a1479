#pragma once

#include <array>
#include <optional>

#include "krot/base/context.h"
#include "krot/bridge/reprojection.h"
#include "krot/joint/working_set.h"
#include "krot/tolerance/tolerance_problem.h"
#include "krot/tolerances.h"

namespace krot::internal {

// Finds the box by working sets: an end that is proved with some observations
// holds for all, and it is reached if the other points fit in, too
// (docs/method/outliers.md, "What the data allow"). The reached and the proved
// end agree to `tolerance`, relative to the way from the centre, unless lenses
// prevent it. The direction of `target` does not matter.
PositionBox FindBox(const ToleranceProblem& problem, const Pull& target,
                    double tolerance, const Context& context);

}  // namespace krot::internal
