#pragma once

#include <cstdint>
#include <map>

#include "krot/base/context.h"
#include "krot/convert/reprojection.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Bounds on how far single observations' projections may move in one round:
// those few, near the folds of strong lenses, whose linear rows promise what
// the lens does not keep.
//
// A bound is one more cone, |u - u_hat| <= radius: as the row
// (w; level/radius B x_cam), with B an orthonormal basis of the plane across
// the ray of x_hat, it is one more observation whose residual is below `level`
// exactly if the bound is kept.
class TrustRegions {
 public:
  bool IsEmpty() const { return radii_.empty(); }
  void Clear() { radii_.clear(); }

  // Halves the way from `from` to `to` of every observation whose true error at
  // `to` exceeds `level`, pixels. Returns how many there are. O(observations).
  int64_t Shrink(const Reprojection& reprojection,
                 const KnownRotationProblem& problem, const Estimate& from,
                 const Estimate& to, Norm norm, double level);

  // The rows with those of the bounds behind those of their points. Observation
  // i of the result is `(*observation_of)[i]` of `rows`, or -1 if it is a
  // bound.
  KnownRotationProblem AddTo(const KnownRotationProblem& rows,
                             const Estimate& x_hat, double level,
                             std::vector<int64_t>* observation_of) const;

 private:
  std::map<int64_t, double> radii_;  // by observation
};

// How far to go along the segment from `from` to `to`, the solution of the
// linear rows taken at `from`, in true errors and in how positions are kept: on
// all of it the rows' cost is at most that at `from` [quasi-convexity], so a
// short enough step lowers the true one wherever `from` is not stationary.

// The best estimate found, `from` if none is below it; `*step` in [0, 1].
// O(observations) per trial.
Estimate BestOnSegment(const Reprojection& reprojection, const Estimate& from,
                       const Estimate& to, Norm norm, const Context& context,
                       double* step);

// The same for every point on its own, where both have the same frames.
Estimate BestPointsOnSegments(const Reprojection& reprojection,
                              const KnownRotationProblem& problem,
                              const Estimate& from, const Estimate& to,
                              Norm norm, int num_threads);

}  // namespace krot::internal
