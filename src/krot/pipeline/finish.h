#pragma once

#include <functional>
#include <optional>

#include "krot/base/context.h"
#include "krot/bridge/reprojection.h"
#include "krot/finish/bounded_least_squares.h"

namespace krot {

// What becomes of the room that the lowest maximum leaves: it is set by a few
// observations, and the others may be anywhere below.
enum class Finish {
  kNone,
  kSweeps,        // every point's and every frame's own maximum is lowered
  kLeastSquares,  // the least squares of all estimates below the cap
};

// As --Solver.finish takes it: "none", "sweeps", "least_squares".
const char* FinishName(Finish finish);

struct FinishOptions {
  Finish finish = Finish::kLeastSquares;
  // eta: every error stays below (1 + slack) times the lowest maximum.
  double slack = 5e-4;        // > 0
  std::optional<double> cap;  // in place of that; pixels; > 0
  double CapAbove(double lowest) const {
    return cap.value_or((1 + slack) * lowest);
  }
  ErrorLoss loss;
  // Told of every iteration; may be empty.
  std::function<void(const BoundedIterate&)> callback;
};

struct FinishSummary {
  double cap = 0;          // pixels
  double lowest_cost = 0;  // the largest error before it, pixels
  ErrorLoss loss;
  BoundedSummary solve;
  double seconds = 0;
};

// The least squares of true errors, over translations and points, with every
// error below the cap; none if the estimate itself is not clearly below it.
// The rows of `problem` are in the end those at `*estimate`.
std::optional<FinishSummary> FinishByLeastSquares(
    const Reprojection& reprojection, const FinishOptions& options, Norm norm,
    double cap, const Context& context, KnownRotationProblem* problem,
    Estimate* estimate);

}  // namespace krot
