#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/conic/interior_point.h"
#include "krot/joint/joint.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/proof/certificate.h"

namespace krot::internal {

struct FeasibleStartOptions {
  Norm norm;
  int max_iterations = 200;  // >= 1
  // A depth that is small against the scene, scene units; it only shapes the
  // way. None: a share of the longest baseline or distance
  // of fixed positions, or 1 where the scale is free.
  std::optional<double> unit_depth;
  // Nothing below this is sought, pixels.
  double known_bound = 0;
  // Gives up once the programme's gap is this small and the
  // bound not met; 0: never.
  double hopeless_gap = 0;
  // Called after every iteration with the bound that it is to meet, pixels; may
  // be empty.
  std::function<void(double bound)> callback;
};

// An estimate of a connected problem whose residuals are all below `bound`,
// pixels, from nothing: FindFeasible with a unit of depth that suits the
// problem's baselines. As that starts from the centre of the cones, the
// estimate is a good start for MinimizeJointly. `*estimate` is only written if
// one is found (kFeasible); otherwise `*multipliers` may prove that there is
// none (MakeInfeasibilityCertificate).
InteriorPointTermination FindEstimateBelow(
    const KnownRotationProblem& problem, double bound,
    const FeasibleStartOptions& options, const Context& context,
    Estimate* estimate, std::vector<Multiplier>* multipliers);

// Lowers an estimate by FindEstimateBelow at a quarter of its cost, again and
// again as long as there is one; returns whether there was. Takes some five
// iterations each.
bool LowerByFeasibility(const KnownRotationProblem& problem,
                        const FeasibleStartOptions& options,
                        const Context& context, Estimate* estimate);

// A start from nothing but rotations and observations: the paper's "one
// bisection iteration at a loose upper bound" [Zhang18, Sec. 4.2].

struct InitializerOptions {
  Norm norm;                 // p = 1, 2 or infinity
  double max_error = 100;    // the bound that the start must meet, pixels; > 0
  int max_iterations = 200;  // per component; >= 1
  JointCallback callback;    // counts over all components; may be empty
};

enum class InitializerTermination {
  kNotRun,
  kFeasible,    // every depth is positive, every residual below max_error
  kInfeasible,  // proved: no estimate does that
  kFailed,      // neither was shown: no estimate was found at any bound
  kInterrupted,
};

struct InitializerSummary {
  InitializerTermination termination = InitializerTermination::kNotRun;
  double cost = 0;  // pixels, of the estimate if feasible
  std::vector<JointIteration> iterations;
  // kInfeasible: proves lower_bound > max_error.
  std::optional<Certificate> certificate;
  double lower_bound = 0;  // pixels, what it proves
};

// Finds an estimate whose residuals are all below max_error, and as far below
// as comes easily, each connected component for itself; `*estimate` is only
// written if there is one, its points and frames without observations not even
// then. Where nothing is fixed and baselines do not set the scale, components
// come out with a median depth of one. Throws std::invalid_argument for options
// out of range.
InitializerSummary FindStart(const KnownRotationProblem& problem,
                             const InitializerOptions& options,
                             const Context& context, Estimate* estimate);

}  // namespace krot::internal
