#pragma once

#include "krot/options/option_table.h"
#include "krot/outliers/tolerant_solve.h"

namespace krot::internal {

// The options of `solver`, without its paths.
void AddSolverOptions(TolerantSolveOptions* options, Context* context,
                      OptionTable* table);

// Defaults that depend on others. Throws OptionError for pairs of options that
// contradict each other, or have no effect. To be called once they are set.
void ResolveSolverOptions(const OptionTable& table, SolveModelOptions* options);

}  // namespace krot::internal
