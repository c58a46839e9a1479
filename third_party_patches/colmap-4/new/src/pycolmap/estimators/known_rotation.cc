// Copyright (c) KROT contributors.
// SPDX-License-Identifier: BSD-3-Clause

#if defined(COLMAP_KROT_ENABLED)

#include "colmap/estimators/known_rotation.h"

#include "colmap/scene/reconstruction.h"

#include "pycolmap/helpers.h"

#include <pybind11/pybind11.h>
#include <pybind11/stl/filesystem.h>

using namespace colmap;
using namespace pybind11::literals;
namespace py = pybind11;

namespace {

// Runs function(options, reconstruction) such that Ctrl-C stops it. Requires
// that Python's lock is released.
template <typename Options>
bool RunInterruptible(bool (*function)(const Options&, Reconstruction&),
                      Options options,
                      Reconstruction& reconstruction) {
  PyInterrupt py_interrupt(0.5);
  options.check_if_stopped = [&py_interrupt]() {
    return py_interrupt.Raised();
  };
  const bool success = function(options, reconstruction);
  py::gil_scoped_acquire acquire;
  if (PyErr_Occurred()) throw py::error_already_set();
  return success;
}

}  // namespace

void BindKnownRotation(py::module& m) {
  auto PyInit = py::enum_<KnownRotationInit>(m, "KnownRotationInit")
                    .value("MODEL", KnownRotationInit::MODEL)
                    .value("FEASIBLE", KnownRotationInit::FEASIBLE);
  AddStringToEnumConstructor(PyInit);

  auto PyFinish =
      py::enum_<KnownRotationFinish>(m, "KnownRotationFinish")
          .value("LEAST_SQUARES", KnownRotationFinish::LEAST_SQUARES)
          .value("NONE", KnownRotationFinish::NONE);
  AddStringToEnumConstructor(PyFinish);

  using Solver = KnownRotationOptions;
  py::classh<Solver> PyKnownRotationOptions(m, "KnownRotationOptions");
  PyKnownRotationOptions.def(py::init<>())
      .def_readwrite("init",
                     &Solver::init,
                     "Where to start; FEASIBLE: from nothing but rotations and "
                     "tracks.")
      .def_readwrite("max_error",
                     &Solver::max_error,
                     "Pixels; few observations are left out so that all others "
                     "are within it. 0: all observations stay or, with FEASIBLE, "
                     "those that noise explains.")
      .def_readwrite("relative_gap",
                     &Solver::relative_gap,
                     "How far the largest error may be above the proved lower "
                     "bound.")
      .def_readwrite("finish",
                     &Solver::finish,
                     "What to choose among all estimates with the lowest "
                     "largest error.")
      .def_readwrite("num_threads", &Solver::num_threads, "-1: all.");
  MakeDataclass(PyKnownRotationOptions);

  using Filter = OutlierFilterOptions;
  py::classh<Filter> PyOutlierFilterOptions(m, "OutlierFilterOptions");
  PyOutlierFilterOptions.def(py::init<>())
      .def_readwrite("max_error",
                     &Filter::max_error,
                     "The bound that all errors are to be within, pixels.")
      .def_readwrite("prove",
                     &Filter::prove,
                     "Whether to prove how many observations had to go at "
                     "least, which takes most of the time.")
      .def_readwrite("conflicts_path",
                     &Filter::conflicts_path,
                     "Where that proof goes, as JSON; empty: nowhere.")
      .def_readwrite("num_threads", &Filter::num_threads, "-1: all.");
  MakeDataclass(PyOutlierFilterOptions);

  using Checker = ModelCheckerOptions;
  py::classh<Checker> PyModelCheckerOptions(m, "ModelCheckerOptions");
  PyModelCheckerOptions.def(py::init<>())
      .def_readwrite("num_worst",
                     &Checker::num_worst,
                     "How many images of each kind, and observations, to log.")
      .def_readwrite("num_threads", &Checker::num_threads, "-1: all.");
  MakeDataclass(PyModelCheckerOptions);

  using Summary = ModelCheckerSummary;
  py::classh<Summary> PyModelCheckerSummary(m, "ModelCheckerSummary");
  PyModelCheckerSummary.def(py::init<>())
      .def_readwrite("is_checked", &Summary::is_checked)
      .def_readwrite("num_wrong_images", &Summary::num_wrong_images)
      .def_readwrite("num_wrong_observations", &Summary::num_wrong_observations)
      .def_readwrite("num_weak_images", &Summary::num_weak_images);
  MakeDataclass(PyModelCheckerSummary);

  m.def(
      "solve_known_rotation",
      [](Reconstruction& reconstruction, const Solver& options) {
        return RunInterruptible(&SolveKnownRotation, options, reconstruction);
      },
      "reconstruction"_a,
      py::arg_v("options", Solver(), "KnownRotationOptions()"),
      py::call_guard<py::gil_scoped_release>(),
      "Lower the largest reprojection error, rotations kept. False where there "
      "is no result; the reconstruction is untouched then.");
  m.def(
      "filter_outliers",
      [](Reconstruction& reconstruction, const Filter& options) {
        return RunInterruptible(&FilterOutliers, options, reconstruction);
      },
      "reconstruction"_a,
      py::arg_v("options", Filter(), "OutlierFilterOptions()"),
      py::call_guard<py::gil_scoped_release>(),
      "Remove few observations so that all others are within max_error.");
  m.def(
      "check_reconstruction",
      [](Reconstruction& reconstruction, const Checker& options) {
        return CheckReconstruction(options, reconstruction);
      },
      "reconstruction"_a,
      py::arg_v("options", Checker(), "ModelCheckerOptions()"),
      py::call_guard<py::gil_scoped_release>(),
      "Log which images and observations are wrong, and remove them.");
}

#endif  // COLMAP_KROT_ENABLED
