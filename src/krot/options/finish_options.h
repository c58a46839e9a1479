#pragma once

#include "krot/options/option_table.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// What follows the lowest maximum, of `solver` alone: Solver.finish and its
// like, Solver.polish.
void AddFinishOptions(SolveModelOptions* options, OptionTable* table);

// Solver.finish_loss and its scale alone.
void AddFinishLoss(SolveModelOptions* options, OptionTable* table);
void CheckFinishLoss(const SolveModelOptions& options,
                     const OptionTable& table);

// Throws OptionError for those that would have no effect. To be called after
// they are set.
void CheckFinishOptions(const SolveModelOptions& options,
                        const OptionTable& table);

}  // namespace krot::internal
