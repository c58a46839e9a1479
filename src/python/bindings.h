#pragma once

#include <pybind11/pybind11.h>

namespace krot::internal {

// The parts of pykrot._core, one source each.
void BindModel(pybind11::module_* module);
void BindCommands(pybind11::module_* module);

}  // namespace krot::internal
