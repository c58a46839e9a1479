#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/model.h"
#include "krot/outliers.h"
#include "krot/outliers/conflict.h"
#include "krot/outliers/decision.h"
#include "krot/outliers/removal.h"

namespace krot::internal {

// Of the images that have a part in most conflicts, and in no fewer than three,
// the one with most observations removed; none otherwise. Points are placed by
// what the removal leaves of all other images, at their optimum; the turn, with
// the camera's position, is then that of least squares in pixels, errors above
// `bound` counting less (Cauchy). Costs three solves.
std::optional<RotationSuspect> FindRotationSuspect(
    const Model& model, const BuiltProblem& built, const ErrorBound& bound,
    const std::vector<Conflict>& conflicts, const Removal& removal,
    const Context& context);

}  // namespace krot::internal
