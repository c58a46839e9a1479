#pragma once

#include <optional>

#include "krot/options/option_table.h"
#include "krot/pipeline/solve_model.h"

namespace krot {

// The options of `solver`, without its paths. `max_error`: what does not fit
// within so many pixels is left out; none: nothing is.
void AddSolverOptions(SolveModelOptions* options,
                      std::optional<double>* max_error, Context* context,
                      OptionTable* table);

// Defaults that depend on others. Throws OptionError for pairs of options that
// contradict each other, or have no effect. To be called once they are set.
void ResolveSolverOptions(const OptionTable& table, SolveModelOptions* options);

}  // namespace krot
