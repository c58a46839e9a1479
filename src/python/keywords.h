#pragma once

#include <pybind11/pybind11.h>

#include "krot/options/option_table.h"

namespace krot::internal {

// Sets options from Python's keywords: `relative_gap` stands for the one option
// whose name ends so behind its group; {"Solver.relative_gap": ...} spells it
// out. Numbers, bools and strings. Throws OptionError with the sentences of the
// command line.
void AssignKeywords(const pybind11::dict& keywords, OptionTable* table);

}  // namespace krot::internal
