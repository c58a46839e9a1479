#pragma once

#include <vector>

#include "krot/base/context.h"
#include "krot/conic/interior_point.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Slack relaxation: by how much observations must exceed a bound b, pixels, in
// all [Olsson, Eriksson, Hartley 2010; Dalalyan, Keriven 2009]:
//
//   min sum_i c_i sigma_i   subject to   ||v_i||_p <= b w_i + sigma_i,
//                                        sigma_i >= 0,  e'x = const.
//
// c_i is observation i's weight over its depth at the start, so that
// c_i sigma_i is in pixels there, and e'x the size of the frames' centres along
// those at the start, which keeps everything from shrinking where no baseline
// sets the scale. (The mean depth, which holds from nothing, would go to a few
// points far away.) The sum stands in for the number of the sigma_i > 0, which
// is what one would like to know.
//
// The dual is about conflicts: multipliers lambda_i <= c_i that are stationary
// (krot/verify/certificate_check.h) but for a multiple of e. An observation
// without a multiplier is in none of them.
struct SlackOptions {
  Norm norm;                    // p = 1, 2 or infinity
  double smallest_mu = 1e-5;    // stop there; of b; > 0
  int max_iterations = 100;     // >= 1
  std::vector<double> weights;  // > 0; empty: 1
};

struct SlackSolution {
  InteriorPointTermination termination = InteriorPointTermination::kNotRun;
  int iterations = 0;
  std::vector<double> slack;  // c_i sigma_i over the weight, pixels
  std::vector<double> price;  // lambda_i / c_i, in [0, 1]
};

// The problem must be connected; depths of `*estimate` need not be positive. If
// most are not, as those of zeros, it starts from nothing: from the origin,
// with mean depth 1, and w_i less a small share of that in place of w_i, as
// otherwise all but a few points would shrink into one. Same memory as
// MinimizeJointly, and about its work per iteration.
SlackSolution MinimizeSlack(const KnownRotationProblem& problem, double bound,
                            const SlackOptions& options, const Context& context,
                            Estimate* estimate);

}  // namespace krot::internal
