#pragma once

#include <optional>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/context.h"
#include "krot/model.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// Bundle adjustment of a COLMAP model: lowers the sum of squared reprojection
// errors, with all errors below a cap if asked for. `krot bundle_adjuster`
// calls it between reading and writing.

struct AdjustModelOptions {
  // With adjustment.max_error, a model with an error that is not below it is
  // first solved as a known rotation problem, which lowers the largest error.
  // With lower_max_error, that solve always comes first.
  BundleAdjustmentOptions adjustment;
  // Replaces adjustment.max_error: the cap is the lowest maximum of the known
  // rotation problem times this factor; > 1.
  std::optional<double> max_error_factor;
  // For the solve of the known rotation problem; it is run without a finish.
  SolveModelOptions start;
  // What the precision refers to, and whether it is computed.
  AdjustmentDatum datum = AdjustmentDatum::kCameras;
  bool finds_precision = false;
};

struct AdjustModelSummary {
  // kInfeasibleStart: no estimate below the cap was found.
  BundleAdjustmentSummary adjustment;
  std::optional<double> max_error;    // the final cap, pixels
  std::optional<SolveSummary> start;  // of AdjustModelOptions::start, if it ran
  // Over all observations of the model.
  PixelErrorStatistics pixel_error_before;
  PixelErrorStatistics pixel_error_start;  // where the adjustment began
  PixelErrorStatistics pixel_error_after;
  std::optional<AdjustmentPrecision> precision;  // if it was asked for
  // As adjustment.distances: whether it contradicts the others, and is left
  // out.
  std::vector<char> is_wrong_distance;
};

struct AdjustModelResult {
  // A copy of the input if there is nothing to adjust or no start below the
  // cap was found.
  Model model;
  AdjustModelSummary summary;
};

// Updates the stored point errors, too. Has the requirements and exceptions of
// AdjustBundle and SolveModel. Throws ModelError if known distances alone give
// the scale, and several of their largest sets agree.
AdjustModelResult AdjustModel(const Model& model,
                              const AdjustModelOptions& options,
                              const Context& context = {});

}  // namespace krot::internal
