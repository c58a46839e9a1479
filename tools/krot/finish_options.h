#pragma once

#include "krot/pipeline/solve_model.h"
#include "tools/krot/option_parser.h"

namespace krot {

// What follows the lowest maximum, of `solver` alone: Solver.finish and its
// like, Solver.polish.
void AddFinishOptions(SolveModelOptions* options, OptionParser* parser);

// Throws OptionError for those that would have no effect. To be called after
// Parse.
void CheckFinishOptions(const SolveModelOptions& options,
                        const OptionParser& parser);

}  // namespace krot
