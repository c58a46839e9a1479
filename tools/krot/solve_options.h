#pragma once

#include <string>

#include "krot/pipeline/solve_model.h"
#include "tools/krot/option_parser.h"

namespace krot {

// The options that `solver` and `point_triangulator` share, in their groups
// Solver, FastDescent and Problem.
void AddSolveOptions(SolveModelOptions* options, Context* context,
                     OptionParser* parser);

// Throws OptionError for pairs of options that contradict each other. To be
// called after Parse.
void CheckSolveOptions(const SolveModelOptions& options,
                       const OptionParser& parser);

}  // namespace krot
