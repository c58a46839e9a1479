#pragma once

#include <optional>
#include <vector>

#include "krot/geometry.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// The optimal cost of a small known rotation problem for p = 1 or infinity,
// independent of the library: bisection on gamma, where each linear programme
//
//   min tau   subject to   h'v_i <= gamma w_i + tau,   w_i >= min_depth,
//
// h the vertices of the dual norm's ball, asks the simplex method of CLP
// whether gamma is attainable (tau <= 0). The optimum must lie in
// (0, upper_bound], pixels. Without baselines the scale is free and any
// min_depth > 0 will do; with them it must be below the optimum's depths.
//
// None if the tests were built without CLP.
std::optional<double> OptimalCostByBisection(
    const KnownRotationProblem& problem, Norm norm, double upper_bound,
    double min_depth);

// The largest h'x over all estimates of no residual above `bound`, pixels, for
// p = 1 or infinity, by the simplex method of CLP: what the problem fixes is
// fixed, and e'x = `kept` if there is an e. x and h stand as points, then
// frames, three numbers each. Infinity if there is no largest.
//
// None if the tests were built without CLP.
std::optional<double> LargestByLp(const KnownRotationProblem& problem,
                                  Norm norm, double bound,
                                  const std::vector<double>& h,
                                  const std::vector<double>& e, double kept);

}  // namespace krot::internal
