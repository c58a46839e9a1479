#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/convert/reprojection.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// Relative tolerance on the radius within which rounds regard a position as
// kept. It is less than what is allowed in the end, so that the finish starts
// strictly inside its constraints.
inline constexpr double kKeptInRounds = kKeptPosition / 2;

// Finds the level of the rows that keep positions, pixels. With rows of level
// L, residuals below a cost keep every camera within cost / L times its radius.
// So their optimum G(L) is that of the true problem where L = G(L). G rises
// with L, but slower than L. The fixed point is found by secant steps in
// logarithms; each step takes one solve.
class PositionLevel {
 public:
  // `tolerance` says how far the cost may end above the optimum, relative.
  explicit PositionLevel(double tolerance) : tolerance_(tolerance) {}

  // Call it after a solve with rows of `level`. `optimum` is the rows' optimum
  // and `cost` the levelled cost of the estimate, all in pixels; `ratio` is the
  // largest ratio of a camera's distance from its position to its radius.
  // Returns the level of the next solve, a little above the fixed point so that
  // positions are kept; none if the present level is good enough.
  std::optional<double> Next(double level, double optimum, double cost,
                             double ratio);

 private:
  double tolerance_;
  double slope_ = 0;
  // All in logarithms: the last level and its optimum, and bounds of the fixed
  // point.
  std::optional<std::pair<double, double>> last_;
  double lowest_ = -std::numeric_limits<double>::infinity();
  double highest_ = std::numeric_limits<double>::infinity();
};

// The additional work of rounds where positions are known (reprojection.h):
// finding the level, remembering the best estimate that keeps all positions,
// and trying proofs at levels below the cost that was reached. Internal to
// SolveInRounds.
class KeptPositions {
 public:
  // Keeps references. Sets the first level: the start's cost.
  KeptPositions(const Model& model, const SolveModelOptions& options,
                const Context& context, const Reprojection& reprojection,
                const Estimate& start, BuiltProblem* built);

  bool Any() const { return !built_.positions.empty(); }

  // The true cost of the best estimate so far that keeps all positions, pixels;
  // infinite without one.
  double cost() const { return cost_; }
  const Estimate& estimate() const { return estimate_; }
  // Remembers the estimate if it keeps all positions and is the best so far.
  void Keep(const Estimate& estimate);

  // Call it after a round whose rows' optimum was `optimum` and that ended at
  // `estimate` with a levelled cost of `cost`. Returns whether another level is
  // needed; if so, the rows of `built` are taken anew at that level.
  bool TakeLevel(const Estimate& estimate, double optimum, double cost);

  // Tries to prove, from the rows' certificate and its support, that no
  // estimate which keeps the positions has all errors below
  // options.init_max_error. None if that is not proved.
  std::optional<PixelCertificate> Refute(const Estimate& estimate,
                                         const Certificate& rows,
                                         std::vector<int64_t> support) const;

  // ProveInPixels, at several levels a little below the estimate's cost until
  // one of them gives a proof.
  std::optional<PixelCertificate> Prove(const Estimate& estimate,
                                        const std::vector<int64_t>& support,
                                        double sufficient) const;

 private:
  double TrueCost(const Estimate& estimate) const {
    return reprojection_.TrueCost(estimate, options_.norm,
                                  context_.num_threads);
  }
  void SetLevel(const Estimate& estimate, double level) const;

  const Model& model_;
  const SolveModelOptions& options_;
  const Context& context_;
  const Reprojection& reprojection_;
  BuiltProblem& built_;
  PositionLevel level_;
  Estimate estimate_;
  double cost_ = std::numeric_limits<double>::infinity();
};

}  // namespace krot::internal
