#pragma once

#include <pybind11/pybind11.h>

#include "krot/options/option_table.h"

namespace krot::internal {

// Sets options from Python's keywords. `relative_gap` means the one option
// whose name behind its group is this; {"Solver.relative_gap": ...} gives the
// whole name. Values may be numbers, bools and strings. Throws OptionError with
// the same sentences as the command line.
void AssignKeywords(const pybind11::dict& keywords, OptionTable* table);

}  // namespace krot::internal
