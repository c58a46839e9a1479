#pragma once

#include <string>

#include "krot/options/option_table.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// The options that `solver` and `point_triangulator` share, in their groups
// Solver, FastDescent and Problem.
void AddSolveOptions(SolveModelOptions* options, Context* context,
                     OptionTable* table);

// Problem.same_image, which `outlier_filter` has as well.
void AddSameImage(BuildProblemOptions* options, OptionTable* table);

// Throws OptionError for pairs of options that contradict each other. To be
// called once they are set.
void CheckSolveOptions(const SolveModelOptions& options,
                       const OptionTable& table);

}  // namespace krot::internal
