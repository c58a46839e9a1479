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

// Within this of the radius, relative, positions are kept in rounds: less than
// is allowed in the end, so that the finish begins inside.
inline constexpr double kKeptInRounds = kKeptPosition / 2;

// The level at which positions are kept, pixels. Rows of a level L have
// residuals below the cost where every camera is within cost / L of its radius,
// so their optimum G(L) is that of the problem at L = G(L). G rises with L,
// slower than L: the fixed point is found by secants in logarithms, a solve
// each.
class PositionLevel {
 public:
  // Relative: by how much the optimum may be missed.
  explicit PositionLevel(double tolerance) : tolerance_(tolerance) {}

  // After a solve at `level` whose rows' optimum is `optimum`, pixels, the
  // estimate having a levelled cost of `cost` and the largest ratio of a
  // camera's distance from its position to the radius: the level of the next
  // one, a little above the fixed point, so that positions are kept; none if
  // the level will do.
  std::optional<double> Next(double level, double optimum, double cost,
                             double ratio);

 private:
  double tolerance_;
  double slope_ = 0;
  // Logarithms: of the last level and its optimum, of bounds of the fixed
  // point.
  std::optional<std::pair<double, double>> last_;
  double lowest_ = -std::numeric_limits<double>::infinity();
  double highest_ = std::numeric_limits<double>::infinity();
};

// What rounds do beside where cameras are known to be (reprojection.h): they
// look for the level, keep the best estimate that keeps all positions, and try
// proofs at levels below what is reached. Internal to SolveInRounds.
class KeptPositions {
 public:
  // Keeps references. Sets the first level: the start's cost.
  KeptPositions(const Model& model, const SolveModelOptions& options,
                const Context& context, const Reprojection& reprojection,
                const Estimate& start, BuiltProblem* built);

  bool Any() const { return !built_.positions.empty(); }

  // Of the best estimate so far that keeps all; infinite without one.
  double cost() const { return cost_; }
  const Estimate& estimate() const { return estimate_; }
  void Keep(const Estimate& estimate);

  // After a round whose rows' optimum was `optimum` and that ended at
  // `estimate` with a levelled cost of `cost`: whether it takes another level.
  // If so, the rows are of that.
  bool TakeLevel(const Estimate& estimate, double optimum, double cost);

  // A proof that positions take every error above what a start may have, from
  // the rows' certificate and its support.
  std::optional<PixelCertificate> Refute(const Estimate& estimate,
                                         const Certificate& rows,
                                         std::vector<int64_t> support) const;

  // ProveInPixels, at levels a little below the estimate's cost.
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
