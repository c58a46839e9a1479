#pragma once

#include <functional>
#include <vector>

#include "krot/base/context.h"
#include "krot/math/norm.h"
#include "krot/minimax/fast_descent.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Resection-Intersection [Zhang18, Alg. 1]: sweeps that minimise every
// point's own maximum residual with the frames fixed, then every frame's with
// the points fixed. With `paper` settings of the descent the sweeps are the
// paper's. With `fast` settings they have momentum, and are coarse at first: a
// block whose maximum is below half of the cost stays where it is, and any
// other stops once a step promises less than a tenth of the last sweep's
// relative gain, kept between 1e-3 and 1e-2. When coarse sweeps no longer help,
// and in the last of `max_sweeps`, every block goes to its optimum.
//
// The result is a fixed point of such sweeps at best. That need not be the
// optimum, whatever the paper says (docs/method/problem.md, "How alternation
// gets stuck").

struct Sweep {
  double cost = 0;     // the lowest so far, up to rounding; pixels
  double seconds = 0;  // wall clock since the start
};

struct ResIntOptions {
  Norm norm;
  // Literally as in the paper, or faster ways to the same sub-problem optima.
  FastDescentOptions fast_descent;
  int max_sweeps = 1000;  // >= 0
  // Stop when sweeps lower the cost by less than this, relative; >= 0.
  double sweep_tolerance = 1e-6;
  // Stop after so many such sweeps in a row; >= 1. A sweep with momentum may
  // fail where the next one, without, does not. Paper settings stop after the
  // first.
  int patience = 3;
  bool update_frames = true;  // false: points only (triangulation)
  // After every sweep, counted from 1; may be empty.
  std::function<void(int sweep, const Sweep&)> callback;
};

enum class ResIntTermination {
  kNotRun,
  kStalled,  // sweeps lower the cost by less than the tolerance
  kMaxSweeps,
  kInterrupted,
};

struct ResIntSummary {
  ResIntTermination termination = ResIntTermination::kNotRun;
  double cost_initial = 0;  // pixels
  double cost_final = 0;    // <= cost_initial
  std::vector<Sweep> sweeps;
};

// Improves `estimate`, all of whose depths must be positive (throws
// std::invalid_argument otherwise). The cost never rises. Beyond the problem
// it needs about 200 bytes per point and per frame.
ResIntSummary SolveResInt(const KnownRotationProblem& problem,
                          const ResIntOptions& options, const Context& context,
                          Estimate* estimate);

}  // namespace krot::internal
