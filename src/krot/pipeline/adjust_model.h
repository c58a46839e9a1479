#pragma once

#include <optional>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/adjust/precision.h"
#include "krot/base/context.h"
#include "krot/model.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// From a COLMAP model to a COLMAP model with a smaller sum of squared
// reprojection errors, below a cap if asked for: what `krot bundle_adjuster`
// does between reading and writing.

struct AdjustModelOptions {
  // With adjustment.max_error, a model whose errors are not all below that is
  // first brought there by the known rotation problem; with lower_max_error it
  // always is brought to the lowest maximum of that.
  BundleAdjustmentOptions adjustment;
  // Takes the place of adjustment.max_error: the cap is so many times the
  // lowest maximum of the known rotation problem; > 1.
  std::optional<double> max_error_factor;
  // For the known rotation problem, which goes without its finish.
  SolveModelOptions start;
  // What the precision refers to, and whether it is computed.
  AdjustmentDatum datum = AdjustmentDatum::kCameras;
  bool finds_precision = false;
};

struct AdjustModelSummary {
  // kInfeasibleStart: no estimate below the cap was found.
  BundleAdjustmentSummary adjustment;
  std::optional<double> max_error;    // the cap of the end, pixels
  std::optional<SolveSummary> start;  // if there was such a solve
  // Over all observations of the model.
  PixelErrorStatistics pixel_error_before;
  PixelErrorStatistics pixel_error_start;  // where the adjustment began
  PixelErrorStatistics pixel_error_after;
  std::optional<AdjustmentPrecision> precision;  // if it was asked for
};

struct AdjustModelResult {
  // A copy of the input if there is nothing to adjust or no start.
  Model model;
  AdjustModelSummary summary;
};

// Stored point errors are updated. Requires and throws as AdjustBundle and
// SolveModel.
AdjustModelResult AdjustModel(const Model& model,
                              const AdjustModelOptions& options,
                              const Context& context = {});

}  // namespace krot::internal
