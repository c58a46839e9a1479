#pragma once

#include <pybind11/pybind11.h>

namespace krot::internal {

// Each adds a part of pykrot._core, and has a source file of its own.
void BindModel(pybind11::module_* module);
void BindCommands(pybind11::module_* module);

}  // namespace krot::internal
