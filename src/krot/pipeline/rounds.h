#pragma once

#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/numbers.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/convert/reprojection.h"
#include "krot/geometry.h"
#include "krot/pipeline/solve_model.h"
#include "krot/pipeline/stages.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// What the rounds of SolveInRounds are made of.

// The bounds that rounds have proved so far: in true pixels, and for the rows
// that were solved last. Decides whether a true cost, in pixels, is near enough
// to them.
struct RoundBounds {
  const double relative_gap;  // asked for
  std::optional<RowsCertificate> rows = {};
  std::optional<PixelCertificate> proof = {};

  void Improve(std::optional<PixelCertificate> other) {
    if (!other) return;
    if (!proof || other->lower_bound > proof->lower_bound) {
      proof = std::move(other);
    }
  }

  bool IsGapReached(double cost) const {
    return proof && std::isfinite(cost) &&
           cost - proof->lower_bound <= relative_gap * cost;
  }
  // A bound that suffices for the gap at this cost. It leaves 5 % of the gap
  // for the rounding of later steps.
  double Sufficient(double cost) const {
    return (1 - 0.95 * relative_gap) * cost;
  }
  // Whether the cost is so near to the rows' bound that a proof in pixels may
  // reach the gap.
  bool IsWorthProving(double cost) const {
    return rows &&
           cost - rows->certificate.lower_bound <= 3 * relative_gap * cost;
  }
  // Whether the bound in pixels suffices for this cost, or the rows' bound is
  // so near to the cost that a proof in pixels, which gives a lower bound than
  // the rows, should suffice, too.
  bool IsNear(double cost) const {
    return (proof && proof->lower_bound >= Sufficient(cost)) ||
           (rows &&
            rows->certificate.lower_bound >= (1 - 0.7 * relative_gap) * cost);
  }
};

// Bounds on how far the projections of single observations may move in one
// round. They are for the few observations, near the folds of strong lenses,
// whose linear row promises a lower error than the lens then has.
//
// A bound is one more cone, |u - u_hat| <= radius: as the row
// (w; level/radius B x_cam), with B an orthonormal basis of the plane across
// the ray of x_hat, it is one more observation, whose residual is at most
// `level` exactly if the bound is kept.
class TrustRegions {
 public:
  bool IsEmpty() const { return radii_.empty(); }
  void Clear() { radii_.clear(); }

  // For every observation whose true error at `to` exceeds `level`, pixels:
  // sets its radius to half of the way that its projection moves between `from`
  // and `to`, or of its present radius if that is less. Returns the number of
  // such observations. O(observations).
  int64_t Shrink(const Reprojection& reprojection,
                 const KnownRotationProblem& problem, const Estimate& from,
                 const Estimate& to, Norm norm, double level);

  // Adds the rows of the bounds, each after the rows of its point. Observation
  // i of the result is `(*observation_of)[i]` of `rows`, or -1 if it is a
  // bound.
  KnownRotationProblem AddTo(const KnownRotationProblem& rows,
                             const Estimate& x_hat, double level,
                             std::vector<int64_t>* observation_of) const;

 private:
  std::map<int64_t, double> radii_;  // by observation
};

// Line search from `from` to `to`, the solution of the linear rows taken at
// `from`, by the levelled cost (reprojection.h). By quasi-convexity the rows'
// cost on the whole segment is at most that at `from`, so a short enough step
// lowers the true cost wherever `from` is not stationary.

// Returns the best estimate found, or `from` if none is better; `*step` is in
// [0, 1]. O(observations) per trial.
Estimate BestOnSegment(const Reprojection& reprojection, const Estimate& from,
                       const Estimate& to, Norm norm, const Context& context,
                       double* step);

// The same for every point on its own, if both estimates have the same frames:
// takes for each the first step tried that does not raise its largest error.
Estimate BestPointsOnSegments(const Reprojection& reprojection,
                              const KnownRotationProblem& problem,
                              const Estimate& from, const Estimate& to,
                              Norm norm, int num_threads);

// Relative tolerance on the radius within which rounds regard a position as
// kept. It is less than what is allowed in the end, so that the finish starts
// strictly inside its constraints.
inline constexpr double kKeptInRounds = kKeptPosition / 2;

// The additional work of rounds where positions are known (reprojection.h):
// finding the level, remembering the best estimate that keeps all positions,
// and trying proofs at levels below the cost that was reached.
//
// With rows of level L, pixels, residuals below a cost keep every camera within
// cost / L times its radius. So their optimum G(L) is that of the true problem
// where L = G(L). G rises with L, but slower than L. The fixed point is found
// by secant steps in logarithms; each step takes one solve.
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
  // `estimate` with a levelled cost of `cost`. `is_held_back` says whether the
  // rows' proof rests on a position. Returns whether another level is needed;
  // if so, the rows of `built` are taken anew at that level.
  bool TakeLevel(const Estimate& estimate, double optimum, double cost,
                 bool is_held_back);

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
  std::optional<double> NextLevel(double optimum, double cost, double ratio,
                                  bool is_held_back);

  const Model& model_;
  const SolveModelOptions& options_;
  const Context& context_;
  const Reprojection& reprojection_;
  BuiltProblem& built_;
  Estimate estimate_;
  double cost_ = kInfinity;
  // How far the cost may end above the optimum, relative.
  const double tolerance_;
  // All in logarithms: the slope d log G / d log L, the last level and its
  // optimum, and bounds of the fixed point.
  double slope_ = 0;
  std::optional<std::pair<double, double>> last_;
  double lowest_ = -kInfinity;
  double highest_ = kInfinity;
};

}  // namespace krot::internal
