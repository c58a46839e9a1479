#pragma once

#include <optional>

#include "krot/base/context.h"
#include "krot/model.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// SolveModel, without what cannot be served: what `krot solver` does between
// reading and writing.

struct TolerantSolveOptions {
  SolveModelOptions solve;
  // Few observations are removed so that all others are within so many pixels,
  // > 0. None: all stay, unless the start is from nothing, no certificate is
  // asked for, and noise does not explain the lowest maximum (RemovalStart);
  // then what it does not explain is removed.
  std::optional<double> max_error;
  // As OutlierFilterOptions has it.
  bool has_start_from_nothing = false;
  bool find_conflicts = false;  // the proof of how many had to go
};

struct TolerantSolveResult {
  // A copy of the input if there is nothing to solve or no start.
  Model model;
  SolveSummary summary;
  // If observations were removed; its own solve is the summary above.
  std::optional<OutlierFilterSummary> outliers;
};

// Requires and throws what SolveModel and FilterOutliers do.
TolerantSolveResult SolveTolerantly(const Model& model,
                                    const TolerantSolveOptions& options,
                                    const Context& context = {});

}  // namespace krot::internal
