#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/linear/blocks.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// The multipliers of observation i: lambda of its depth, y of its v, with
// ||y||_dual <= lambda.
struct Multiplier {
  double lambda = 0;
  Eigen::Vector2d y = Eigen::Vector2d::Zero();
};

// What an iteration has reached.
struct ConicIterate {
  int iteration = 0;
  double gamma = 0;  // every residual is below it, pixels; MinimizeLinear: h'x
  double cost = 0;   // the largest residual, pixels
  // Complementarity relative to gamma. Not a bound: see certificate.h.
  double gap = 0;
  double step = 0;  // length of the last step, in [0, 1]
  const Estimate* estimate = nullptr;
  const std::vector<Multiplier>* multipliers = nullptr;
};

struct InteriorPointOptions {
  Norm norm;                  // p = 1, 2 or infinity
  double start_margin = 0.1;  // gamma starts at (1 + margin) cost; > 0
  // MinimizeJointly: those of a similar problem's last iterate, per
  // observation, zero where they are not known. The smaller the margin is, the
  // nearer to them it starts. May alias the output.
  const std::vector<Multiplier>* known_multipliers = nullptr;
  double smallest_gap = 1e-9;  // stop there, relative; > 0
  int max_iterations = 200;    // >= 1
  // Called after every iteration; true ends the solve.
  std::function<bool(const ConicIterate&)> stop;
};

enum class InteriorPointTermination {
  kNotRun,
  kConverged,  // what was asked for: a small gap, or all tolerances
  kStopped,    // options.stop said so
  kFeasible,   // FindFeasible: every residual is below the bound
  kMaxIterations,
  kNoProgress,  // steps have become too short, or gain next to nothing
  kSingular,    // the linear system could not be factorised
  kInterrupted,
};

struct InteriorPointSummary {
  InteriorPointTermination termination = InteriorPointTermination::kNotRun;
  int iterations = 0;
  double gamma = 0;
  double gap = 0;
};

// Minimises the largest residual over all frames and points together, by a
// primal-dual interior point method on
//
//   min gamma   subject to   (gamma w_i, v_i) in the cone ||v||_p <= gamma w
//
// in (x, gamma) at once (docs/method/joint_solver.md). The problem
// must be connected and all depths of `*estimate` positive (throws
// std::invalid_argument otherwise); it is left at the best iterate, never
// worse than the start. `multipliers` are those of the last iterate.
InteriorPointSummary MinimizeJointly(const KnownRotationProblem& problem,
                                     const InteriorPointOptions& options,
                                     const Context& context, Estimate* estimate,
                                     std::vector<Multiplier>* multipliers);

// Looks for an estimate whose residuals are all below `bound` > 0, pixels, by
//
//   min tau   subject to   ||v_i||_p <= bound (w_i - 1 + tau),
//
// from scratch: `*estimate` is only written, and only if one is found
// (kFeasible). Otherwise the multipliers converge to a proof that there is
// none. `stop` sees tau as gamma. With metric baselines, or fixed positions,
// the depth of 1 is replaced by `unit_depth`, scene units, which must be small
// against the scene.
InteriorPointSummary FindFeasible(const KnownRotationProblem& problem,
                                  const InteriorPointOptions& options,
                                  const Context& context, double bound,
                                  double unit_depth, Estimate* estimate,
                                  std::vector<Multiplier>* multipliers);

// h'x, to be minimised along e'x = const. x stands for points and for the
// frames' centres in the world, -R_rw' t_f.
struct LinearObjective {
  BlockVector h;
  std::optional<BlockVector> e;  // none: nothing of the kind is kept
};

// How far estimates whose residuals are all at most `bound` > 0, pixels, reach
// in one direction:
//
//   min h'x   subject to   ||v_i||_p <= bound w_i,   e'x as at the start,
//
// from `*estimate`, whose residuals must all be below the bound (throws
// std::invalid_argument otherwise) and which becomes the one with the lowest
// h'x that was met. The problem must be connected and something in it fixed.
// Soon the dual residual is h but for rounding and a multiple of e, and then
// the multipliers prove what krot/verify/extent_check.h says. The gap is
// relative to how far it is from the start to the end that they prove.
InteriorPointSummary MinimizeLinear(const KnownRotationProblem& problem,
                                    const InteriorPointOptions& options,
                                    const Context& context, double bound,
                                    const LinearObjective& objective,
                                    Estimate* estimate,
                                    std::vector<Multiplier>* multipliers);

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
