#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/bridge/pixel_certificate.h"
#include "krot/bridge/reprojection.h"
#include "krot/pipeline/position_level.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// What rounds do beside where cameras are known to be (position_rows.h): they
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
