#pragma once

#include <cstdint>
#include <map>

#include "krot/base/context.h"
#include "krot/convert/reprojection.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

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

}  // namespace krot::internal
