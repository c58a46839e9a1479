#pragma once

#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/linear/block_structure.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/verify/extent_check.h"
#include "krot/verify/pull.h"

namespace krot::internal {

// A row that keeps the scale where nothing else does: direction'x of the view's
// centre stays what it is at the start.
using ScaleRow = Pull;

struct ExtentOptions {
  Norm norm;                // p = 1, 2 or infinity
  double bound = 0;         // of all residuals, pixels; > 0
  double tolerance = 0.01;  // of the way from the start to the proved end; > 0
  int max_iterations = 100;
};

// How far estimates reach whose residuals are all below the bound.
struct Extent {
  Estimate estimate;             // that reaches the farthest
  std::optional<double> proved;  // p'x is no more: CheckExtent; scene units
  int iterations = 0;
};

// Maximises p'x of `pull` from `start`, which must be below the bound. Nothing
// is proved where there is no end, or where double precision does not suffice.
// The problem must be connected and something in it fixed.
Extent FindExtent(const KnownRotationProblem& problem, const Pull& pull,
                  const std::optional<ScaleRow>& scale,
                  const ExtentOptions& options, const Context& context,
                  const Estimate& start);

// The gradient of p'x by points and frames' centres; 0 where they are fixed.
BlockVector CoefficientsOf(const KnownRotationProblem& problem,
                           const Pull& pull);

}  // namespace krot::internal
