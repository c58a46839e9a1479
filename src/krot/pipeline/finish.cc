#include "krot/pipeline/finish.h"

#include <utility>

#include "krot/base/timer.h"

namespace krot {
namespace {

// An estimate that is nearer to the cap, relative, leaves no room.
constexpr double kLeastRoom = 1e-6;
// What rounding may add to the largest error, relative.
constexpr double kRounding = 1e-7;

}  // namespace

const char* FinishName(Finish finish) {
  switch (finish) {
    case Finish::kSweeps:
      return "sweeps";
    case Finish::kLeastSquares:
      return "least_squares";
    case Finish::kNone:
      break;
  }
  return "none";
}

std::optional<FinishSummary> FinishByLeastSquares(
    const Reprojection& reprojection, const FinishOptions& options, Norm norm,
    double cap, const Context& context, KnownRotationProblem* problem,
    Estimate* estimate) {
  const auto true_cost = [&](const Estimate& x) {
    return reprojection.TrueCost(x, norm, context.num_threads);
  };
  const Timer timer;
  FinishSummary summary;
  summary.cap = cap;
  summary.loss = options.loss;
  summary.lowest_cost = true_cost(*estimate);
  if (!(summary.lowest_cost < (1 - kLeastRoom) * cap)) return std::nullopt;

  BoundedOptions bounded;
  bounded.norm = norm;
  bounded.cap = (1 - kRounding) * cap;
  bounded.loss = options.loss;
  bounded.callback = options.callback;
  if (!reprojection.IsLinear()) {
    bounded.take_rows = [&](const Estimate& x, KnownRotationProblem* rows) {
      return reprojection.TakeRows(x, context.num_threads, rows);
    };
  }
  Estimate finished = *estimate;
  summary.solve = MinimizeBounded(*problem, bounded, context, &finished);
  summary.seconds = timer.Seconds();
  if (!(true_cost(finished) <= cap)) return std::nullopt;
  *estimate = std::move(finished);
  reprojection.TakeRows(*estimate, context.num_threads, problem);
  return summary;
}

}  // namespace krot
