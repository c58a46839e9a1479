#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/bridge/pixel_certificate.h"
#include "krot/math/norm.h"
#include "krot/model.h"

namespace krot::internal {

// The lowest largest error of some observations, proved.
struct OptimumWithout {
  Estimate estimate;     // of the whole
  double max_error = 0;  // there, true pixels
  // That no translations and points bring them below; true pixels, 0 without a
  // proof, which CheckPixelCertificate accepted otherwise.
  double lower_bound = 0;
  std::optional<PixelCertificate> proof;  // of the built problem
};

// Of all observations but the `removed` (ascending), by SolveInRounds from
// `start`, where the depths of the others must be positive. Those that alone
// hold a point or a frame bound nothing and have no part.
OptimumWithout SolveWithout(const Model& model, const BuiltProblem& built,
                            const std::vector<int64_t>& removed,
                            const Estimate& start, Norm norm,
                            double relative_gap, const Context& context);

}  // namespace krot::internal
