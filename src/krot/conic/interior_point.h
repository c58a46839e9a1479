#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/geometry.h"
#include "krot/linear/blocks.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// The multipliers of observation i: lambda of its depth, y of its v, with
// ||y||_dual <= lambda.
struct Multiplier {
  double lambda = 0;
  Eigen::Vector2d y = Eigen::Vector2d::Zero();
};

// The state after an iteration.
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
  // For MinimizeJointly: the multipliers of a similar problem's last iterate,
  // one per observation, zero where unknown. The smaller start_margin is, the
  // nearer to them the multipliers start. May alias the output.
  const std::vector<Multiplier>* known_multipliers = nullptr;
  double smallest_gap = 1e-9;  // stop there, relative; > 0
  int max_iterations = 200;    // >= 1
  // Called after every iteration; true ends the solve.
  std::function<bool(const ConicIterate&)> stop;
};

enum class InteriorPointTermination {
  kNotRun,
  kConverged,  // the gap is small enough, or all tolerances are met
  kStopped,    // options.stop returned true
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
// std::invalid_argument otherwise). `*estimate` becomes the best iterate, never
// worse than the start. `multipliers` are those of the last iterate.
InteriorPointSummary MinimizeJointly(const KnownRotationProblem& problem,
                                     const InteriorPointOptions& options,
                                     const Context& context, Estimate* estimate,
                                     std::vector<Multiplier>* multipliers);

// Looks for an estimate whose residuals are all below `bound` > 0, pixels, by
//
//   min tau   subject to   ||v_i||_p <= bound (w_i - 1 + tau),
//
// starting from nothing: `*estimate` is not read, and is written only if an
// estimate is found (kFeasible). Otherwise the multipliers converge to a proof
// that there is none. ConicIterate::gamma is tau. In general the depth of 1 is
// `unit_depth`, scene units; with metric baselines or fixed positions it must
// be small against the scene.
InteriorPointSummary FindFeasible(const KnownRotationProblem& problem,
                                  const InteriorPointOptions& options,
                                  const Context& context, double bound,
                                  double unit_depth, Estimate* estimate,
                                  std::vector<Multiplier>* multipliers);

// h'x, to be minimised along e'x = const. x stands for points and for the
// frames' centres in the world, -R_rw' t_f.
struct LinearObjective {
  BlockVector h;
  std::optional<BlockVector> e;  // none: without this constraint
};

// Finds how far estimates whose residuals are all at most `bound` > 0, pixels,
// reach in one direction:
//
//   min h'x   subject to   ||v_i||_p <= bound w_i,   e'x as at the start,
//
// starting from `*estimate`, whose residuals must all be below the bound
// (throws std::invalid_argument otherwise). It becomes the iterate with the
// lowest h'x. The problem must be connected and something in it must be fixed.
// After the first iterations the multipliers satisfy stationarity up to
// rounding (A'z = h plus a multiple of e); then they prove what
// krot/verify/certificate_check.h says. The gap is relative to the distance, in
// h'x, from the start to the bound that they prove.
InteriorPointSummary MinimizeLinear(const KnownRotationProblem& problem,
                                    const InteriorPointOptions& options,
                                    const Context& context, double bound,
                                    const LinearObjective& objective,
                                    Estimate* estimate,
                                    std::vector<Multiplier>* multipliers);

// Slack relaxation: finds the smallest sum of the amounts by which observations
// must exceed a bound b, pixels [Olsson, Eriksson, Hartley 2010; Dalalyan,
// Keriven 2009]:
//
//   min sum_i c_i sigma_i   subject to   ||v_i||_p <= b w_i + sigma_i,
//                                        sigma_i >= 0,  e'x = const.
//
// c_i is observation i's weight over its depth at the start, so that
// c_i sigma_i is in pixels there. e'x keeps everything from shrinking where no
// baseline sets the scale: it is the projection of the frames' centres on those
// at the start. (A start from nothing holds the mean depth instead; otherwise
// that would let a few points far away take up the scale.) The sum is the
// convex substitute for the number of the sigma_i > 0, which is what one would
// like to minimise.
//
// The dual describes conflicts: multipliers lambda_i <= c_i that are stationary
// (krot/verify/certificate_check.h) but for a multiple of e. An observation
// without a multiplier is in no conflict.
struct SlackOptions {
  Norm norm;                    // p = 1, 2 or infinity
  double smallest_mu = 1e-5;    // stop there; relative to b; > 0
  int max_iterations = 100;     // >= 1
  std::vector<double> weights;  // > 0; empty: 1
};

struct SlackSolution {
  InteriorPointTermination termination = InteriorPointTermination::kNotRun;
  int iterations = 0;
  std::vector<double> slack;  // c_i sigma_i over the weight, pixels
};

// The problem must be connected; depths of `*estimate` need not be positive. If
// most are not, as if everything is at the origin, it starts from nothing: with
// all at the origin, the mean depth held at 1, and w_i - 0.05 in place of w_i,
// as otherwise all but a few points would shrink into one. Takes the memory of
// MinimizeJointly, and about its work per iteration.
SlackSolution MinimizeSlack(const KnownRotationProblem& problem, double bound,
                            const SlackOptions& options, const Context& context,
                            Estimate* estimate);

}  // namespace krot::internal
