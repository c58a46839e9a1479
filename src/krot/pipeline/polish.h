#pragma once

#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/context.h"
#include "krot/finish/bounded_least_squares.h"
#include "krot/model.h"

namespace krot::internal {

// Least squares after the known rotation problem: a lower mean error, for a
// maximum that is no longer the lowest.
enum class Polish {
  kNone,
  kRotationsFixed,  // translations and points
  kFull,            // bundle adjustment with its default options
};

struct PolishSummary {
  Polish polish = Polish::kNone;
  BundleAdjustmentSummary adjustment;
  PixelErrorStatistics pixel_error;  // over all observations, afterwards
};

// Adjusts the model in place, by least squares or the least of a robust loss,
// and updates its stored point errors; what is fixed stays. `polish` must not
// be kNone.
PolishSummary PolishModel(Polish polish, const ErrorLoss& loss,
                          const FixedParts& fixed, const Context& context,
                          Model* model);

// As --Solver.polish takes it: "none", "rotations_fixed", "full".
const char* PolishName(Polish polish);

}  // namespace krot::internal
