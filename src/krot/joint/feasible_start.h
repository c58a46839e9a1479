#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/conic/interior_point.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

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

}  // namespace krot
