#pragma once

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/model.h"
#include "krot/outliers/outlier_filter.h"

namespace krot::internal {

// Where the removal of observations starts.
struct RemovalStart {
  // Of all observations that the start can serve; depths of built.start need
  // not be positive if it is from nothing.
  BuiltProblem built;
  SolveInit init = SolveInit::kModel;
  double max_error = 0;  // the bound: as asked for, or chosen; 0: noise's
  // From nothing without a bound: the start's errors are not far above what
  // noise explains, so that no observation may have to go; or the model has
  // positions of its own, at which noise explains half of its errors.
  bool nearly_fits = false;
  bool fits_its_positions = false;
};

// The model's own start or, if options.solve.init says so or the model has
// none (HasOwnStart), FindRobustStart's. Says which, and the bound.
RemovalStart FindRemovalStart(const Model& model,
                              const OutlierFilterOptions& options,
                              const Context& context);

}  // namespace krot::internal
