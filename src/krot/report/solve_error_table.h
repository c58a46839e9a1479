#pragma once

#include <string>

#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// The errors before, after and, if there was such a step, polished, which a
// sentence then explains.
std::string SolveErrorTable(const SolveSummary& summary);

}  // namespace krot::internal
