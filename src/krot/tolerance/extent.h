#pragma once

#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/math/norm.h"
#include "krot/proof/extent_check.h"

namespace krot {

// What keeps the scale where nothing else does: direction'x of the view's
// centre is what it is at the start.
using ScaleRow = Pull;

struct ExtentOptions {
  Norm norm;                // p = 1, 2 or infinity
  double bound = 0;         // of all residuals, pixels; > 0
  double tolerance = 0.01;  // of the way from the start to the proved end; > 0
  int max_iterations = 100;
};

// How far the estimates reach whose residuals are all below the bound.
struct Extent {
  Estimate estimate;             // that reaches the farthest
  std::optional<double> proved;  // p'x is no more: CheckExtent; scene units
  int iterations = 0;
};

// Along `pull`, from `start`, which must be below the bound. Unproved where
// there is no end, or where numbers do not suffice. The problem must be
// connected and something in it fixed.
Extent FindExtent(const KnownRotationProblem& problem, const Pull& pull,
                  const std::optional<ScaleRow>& scale,
                  const ExtentOptions& options, const Context& context,
                  const Estimate& start);

}  // namespace krot
