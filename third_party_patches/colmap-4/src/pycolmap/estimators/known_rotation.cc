// Copyright (c) KROT contributors.
// SPDX-License-Identifier: BSD-3-Clause

#if defined(COLMAP_KROT_ENABLED)

#include "colmap/estimators/known_rotation.h"

#include "colmap/scene/reconstruction.h"

#include "pycolmap/helpers.h"

#include <pybind11/pybind11.h>

using namespace colmap;
using namespace pybind11::literals;
namespace py = pybind11;

void BindKnownRotation(py::module& m) {
  using Solver = KnownRotationOptions;
  py::classh<Solver> PyKnownRotationOptions(m, "KnownRotationOptions");
  PyKnownRotationOptions.def(py::init<>())
      .def_readwrite("init",
                     &Solver::init,
                     "\"model\", or \"feasible\": from nothing but rotations "
                     "and tracks.")
      .def_readwrite("max_error",
                     &Solver::max_error,
                     "Pixels; above 0: few observations are left out so that "
                     "all others are within it.")
      .def_readwrite("relative_gap",
                     &Solver::relative_gap,
                     "How far the largest error may be above the proved bound.")
      .def_readwrite("finish",
                     &Solver::finish,
                     "\"least_squares\", \"sweeps\" or \"none\".")
      .def_readwrite("finish_loss",
                     &Solver::finish_loss,
                     "\"trivial\", \"huber\" or \"cauchy\".")
      .def_readwrite("num_threads", &Solver::num_threads, "-1: all.");
  MakeDataclass(PyKnownRotationOptions);

  using Filter = OutlierFilterOptions;
  py::classh<Filter> PyOutlierFilterOptions(m, "OutlierFilterOptions");
  PyOutlierFilterOptions.def(py::init<>())
      .def_readwrite("max_error",
                     &Filter::max_error,
                     "The bound that all errors are to be within, pixels.")
      .def_readwrite("num_threads", &Filter::num_threads, "-1: all.");
  MakeDataclass(PyOutlierFilterOptions);

  m.def(
      "solve_known_rotation",
      [](Reconstruction& reconstruction, const Solver& options) {
        return SolveKnownRotation(options, reconstruction);
      },
      "reconstruction"_a,
      py::arg_v("options", Solver(), "KnownRotationOptions()"),
      py::call_guard<py::gil_scoped_release>(),
      "Lower the largest reprojection error, rotations kept. False where there "
      "is no result; the reconstruction is untouched then.");
  m.def(
      "filter_outliers",
      [](Reconstruction& reconstruction, const Filter& options) {
        return FilterOutliers(options, reconstruction);
      },
      "reconstruction"_a,
      py::arg_v("options", Filter(), "OutlierFilterOptions()"),
      py::call_guard<py::gil_scoped_release>(),
      "Remove few observations so that all others are within max_error.");
}

#endif  // COLMAP_KROT_ENABLED
