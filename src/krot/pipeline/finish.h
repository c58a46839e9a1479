#pragma once

#include <functional>
#include <optional>

#include "krot/finish/bounded_least_squares.h"

namespace krot::internal {

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
  double slack = 5e-4;  // > 0
  // Pixels; > 0: the cap instead; no finish if the lowest maximum is above it.
  std::optional<double> max_error;
  ErrorLoss loss;
  // Told of every iteration; may be empty.
  std::function<void(const BoundedIterate&)> callback;
};

// Of a finish by least squares.
struct FinishSummary {
  double cap = 0;          // pixels
  double lowest_cost = 0;  // the largest error before it, pixels
  ErrorLoss loss;
  BoundedSummary solve;
  double seconds = 0;
};

}  // namespace krot::internal
