// pykrot._core: KROT's commands for Python, which exchange models without
// files.

#include <pybind11/pybind11.h>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/write_file.h"
#include "krot/context.h"
#include "krot/options/option_table.h"
#include "krot/version.h"
#include "python/bindings.h"

PYBIND11_MODULE(_core, module) {
  namespace py = pybind11;
  krot::internal::SilenceCeres();
  module.attr("__version__") = KROT_VERSION;
  py::register_exception<krot::ModelError>(module, "ModelError",
                                           PyExc_ValueError);
  py::register_exception<krot::internal::OptionError>(module, "OptionError",
                                                      PyExc_ValueError);
  py::register_exception<krot::WriteError>(module, "WriteError", PyExc_OSError);
  krot::internal::BindModel(&module);
  krot::internal::BindCommands(&module);
}
