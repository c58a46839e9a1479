#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/conic/interior_point.h"
#include "krot/geometry.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// The least squares among all estimates with every error below a cap:
//
//   min 1/2 sum rho(|e_i|^2)   subject to   ||e_i||_p <= cap,  e_i = v_i / w_i,
//
// over all frames and points at once, by a primal-dual interior point method
// (docs/method/joint_solver.md, "The finish"). The constraints are convex, the
// sum is not: what is found is a local minimum.

// rho of a squared error, squared pixels: rho(s) = s for small s, and grows
// less beyond the scale. As in Ceres.
struct ErrorLoss {
  enum class Kind { kTrivial, kHuber, kCauchy };
  Kind kind = Kind::kTrivial;
  double scale = 1;  // pixels; > 0

  double Value(double s) const {
    const double b = scale * scale;
    if (kind == Kind::kHuber && s > b) return 2 * scale * std::sqrt(s) - b;
    return kind == Kind::kCauchy ? b * std::log1p(s / b) : s;
  }

  // rho'(s), in (0, 1].
  double Weight(double s) const {
    const double b = scale * scale;
    if (kind == Kind::kHuber && s > b) return scale / std::sqrt(s);
    return kind == Kind::kCauchy ? 1 / (1 + s / b) : 1;
  }
};

// The names that --Solver.finish_loss takes: "trivial", "huber", "cauchy".
inline const char* LossName(ErrorLoss::Kind kind) {
  return kind == ErrorLoss::Kind::kHuber    ? "huber"
         : kind == ErrorLoss::Kind::kCauchy ? "cauchy"
                                            : "trivial";
}

// An iterate; every one of them is below the cap.
struct BoundedIterate {
  int iteration = 0;
  double cost = 0;  // 1/2 sum rho, squared pixels
  double gap = 0;   // sum of multiplier times slack, relative to the cost
  double step = 0;  // length of the step that led here, in (0, 1]
};

struct BoundedOptions {
  Norm norm;       // of the cap: p = 1, 2 or infinity
  double cap = 0;  // pixels; > 0
  // Only the errors of the first num_views views are squared; all other
  // observations are bounds alone. None: all are squared.
  std::optional<int32_t> num_views;
  ErrorLoss loss;
  double gap_tolerance = 1e-3;           // > 0, relative to the cost
  double stationarity_tolerance = 1e-5;  // > 0
  int max_iterations = 200;              // >= 1
  // Takes all rows of the problem itself anew, where their points project at an
  // estimate; false if one does not project. Empty if rows do not depend on the
  // estimate.
  std::function<bool(const Estimate&)> take_rows;
  std::function<void(const BoundedIterate&)> callback;  // may be empty
};

struct BoundedSummary {
  InteriorPointTermination termination = InteriorPointTermination::kNotRun;
  int iterations = 0;
  double cost_initial = 0;  // 1/2 sum rho, squared pixels
  double cost_final = 0;    // <= cost_initial
  // Sum of multiplier times slack relative to the cost: were the problem
  // convex, no estimate would be lower by more.
  std::optional<double> duality_gap;
  // What Newton's step would still gain on the central path, relative to the
  // cost.
  std::optional<double> stationarity;
  int64_t num_active = 0;  // multipliers above 1e-3 of an error's own weight
};

// Requires an estimate with every residual below the cap (throws
// std::invalid_argument). Every iterate stays there. Rows of `problem` must be
// those at `*estimate`; with take_rows they are so afterwards. Of every
// connected component the frame with the most observations stays, and the scale
// is free where no baseline sets it. An iteration takes about as long as one of
// MinimizeJointly; the same bits at any number of threads.
BoundedSummary MinimizeBounded(const KnownRotationProblem& problem,
                               const BoundedOptions& options,
                               const Context& context, Estimate* estimate);

// Gives both observations of every track of two the mean of their squared
// errors, since its point may take up either of them: medians would see zeros.
void ShareErrorsOfPairs(const KnownRotationProblem& problem,
                        std::vector<double>* squared_errors);

// Moves points and frames to a local minimum of
//
//   sum_i c^2 r_i^2 / (c^2 + r_i^2),   c twice the median of the r_i,
//
// with r_i the residuals in pixels (p = 2; in the median those of a pair have
// their mean square) [Geman, McClure 1987], by Gauss and Newton's method with
// weights (c^2 / (c^2 + r_i^2))^2. c is taken anew after every step, at first
// as sixteen times the median, and half as many each time [Blake, Zisserman
// 1987]. An observation that does not see its point counts c^2; a point that
// none sees stays. Steps are damped by the relative changes of the depths, so
// that neither the scale nor what the observations hardly hold runs away:
//
//   sum_i weight_i (|r_i + dr_i|^2 + (damping c dw_i / w_i)^2).
//
// The problem may have several components and must have nothing fixed. Ends
// where a step lowers the sum by less than `tolerance` of it, at the latest
// after 30. If most observations do not see their points, nothing moves. The
// same bits at any number of threads. A step takes O(observations) and a
// factorisation of the reduced camera system.
void MinimizeRobustly(const KnownRotationProblem& problem,
                      const Context& context, Estimate* estimate,
                      double tolerance = 3e-4);

// The softest motion of a problem: of all that change depths, the one that
// changes errors least. With dr_i and dw_i / w_i the changes of an error and of
// a relative depth as frames and points move, it minimises
//
//   sum |dr_i|^2 / sum (dw_i / w_i)^2 .
//
// Parts whose relative scale nothing ties grow and shrink at no cost. A common
// scale, which changes all depths alike, is left out where it is free.
// Depths count only in tracks that tell them to a tenth, and in frames with
// three of these: other tracks would give the softest motion, each its own.
struct SoftestMotion {
  // dw / w of the median point that a frame sees; all are at most about one.
  // None where no depth counts.
  std::vector<std::optional<double>> changes;
  // The standard deviation of that motion, in which `changes` are one; infinite
  // if nothing opposes it.
  double deviation = 0;
};

// At an estimate, to first order, for noise of `sigma` pixels per axis. Nothing
// may be fixed. Takes a factor of the reduced camera system.
SoftestMotion FindSoftestMotion(const KnownRotationProblem& problem,
                                const Estimate& estimate, double sigma,
                                const Context& context);

}  // namespace krot::internal
