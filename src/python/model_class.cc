// pykrot._core: KROT's commands for Python, which exchange models without
// files. Here are pykrot.Model, and the module.

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/analysis/model_input.h"
#include "krot/analysis/noise.h"
#include "krot/base/write_file.h"
#include "krot/context.h"
#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "krot/options/option_table.h"
#include "krot/report/sentences.h"
#include "krot/version.h"
#include "python/keywords.h"
#include "python/model_arrays.h"

namespace krot::internal {
namespace {

namespace py = pybind11;

std::shared_ptr<Model> Read(const std::filesystem::path& path,
                            const std::string& on_contradiction) {
  auto model = std::make_shared<Model>();
  *model = ReadModel(path, DetectModelFormat(path));
  const Contradictions contradictions =
      SettleContradictions(on_contradiction, model.get());
  ValidateModel(*model);
  if (!contradictions.Any()) return model;
  if (on_contradiction == "refuse") throw ModelError(contradictions.first);
  RequireSettled(path.string(), contradictions);
  const std::string sentence =
      path.string() + ContradictionSentence(contradictions);
  if (PyErr_WarnEx(PyExc_UserWarning, sentence.c_str(), 1) != 0) {
    throw py::error_already_set();
  }
  return model;
}

void Write(const Model& model, const std::filesystem::path& path,
           const std::string& output_type, bool overwrite) {
  if (output_type != "BIN" && output_type != "TXT") {
    throw OptionError("output_type = " + output_type +
                      ", must be one of {BIN, TXT}");
  }
  WriteModelOptions options;
  options.format =
      output_type == "TXT" ? ModelFormat::kText : ModelFormat::kBinary;
  options.overwrite = overwrite;
  WriteModel(model, path, options);
}

// A view of one member of all records, without a copy. Writing to it changes
// the model; the view keeps the model alive.
template <typename Record, typename T>
py::array_t<T> View(std::vector<Record>& records, T* first, int64_t columns,
                    const py::object& owner) {
  const int64_t count = static_cast<int64_t>(records.size());
  if (count == 0) return py::array_t<T>(std::vector<int64_t>{0, columns});
  return py::array_t<T>(
      std::vector<int64_t>{count, columns},
      std::vector<int64_t>{static_cast<int64_t>(sizeof(Record)),
                           static_cast<int64_t>(sizeof(T))},
      first, owner);
}

Model& Get(const py::object& self) { return self.cast<Model&>(); }

py::array_t<double> Points(const py::object& self) {
  std::vector<Point3D>& points = Get(self).points3D;
  return View(points, points.empty() ? nullptr : points[0].xyz.data(), 3, self);
}

py::array_t<uint8_t> Colors(const py::object& self) {
  std::vector<Point3D>& points = Get(self).points3D;
  return View(points, points.empty() ? nullptr : points[0].color.data(), 3,
              self);
}

// Copies one value of each record, if values are small or have to be computed.
template <typename Records, typename Of>
auto Collect(const Records& records, const Of& of) {
  using T = decltype(of(records.front()));
  py::array_t<T> array(static_cast<int64_t>(records.size()));
  T* out = array.mutable_data();
  for (const auto& record : records) *out++ = of(record);
  return array;
}

py::array_t<double> Rotations(const Model& model) {
  py::array_t<double> array(
      {static_cast<int64_t>(model.images.size()), int64_t{3}, int64_t{3}});
  double* out = array.mutable_data();
  for (const ImageGeometry& image : ImageGeometries(model)) {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> to(out);
    to = image.cam_from_world.rotation;
    out += 9;
  }
  return array;
}

template <typename Of>
py::array_t<double> OfImages(const Model& model, const Of& of) {
  py::array_t<double> array(
      {static_cast<int64_t>(model.images.size()), int64_t{3}});
  double* out = array.mutable_data();
  for (const ImageGeometry& image : ImageGeometries(model)) {
    Eigen::Map<Eigen::Vector3d> to(out);
    to = of(image.cam_from_world);
    out += 3;
  }
  return array;
}

py::array_t<double> Translations(const Model& model) {
  return OfImages(
      model, [](const RigidTransform& transform) -> const Eigen::Vector3d& {
        return transform.translation;
      });
}

py::array_t<double> Centers(const Model& model) {
  return OfImages(model, [](const RigidTransform& transform) {
    return Eigen::Vector3d(Center(transform));
  });
}

std::vector<std::string> Names(const Model& model) {
  std::vector<std::string> names;
  for (const Image& image : model.images) names.push_back(image.name);
  return names;
}

// Three columns with a row for each track element: its pixel, and the indices
// of its image and point.
py::tuple Observations(const Model& model) {
  const int64_t count = static_cast<int64_t>(model.track_elements.size());
  py::array_t<double> pixels({count, int64_t{2}});
  py::array_t<int64_t> images(count);
  py::array_t<int64_t> points(count);
  const auto index_of = ImageIndices(model);
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const Point3D& point = model.points3D[k];
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = model.track_elements[e];
      const int32_t image = index_of.at(element.image_id);
      const Point2D& point2D =
          model.images[image].points2D[element.point2D_idx];
      pixels.mutable_data()[2 * e] = point2D.x;
      pixels.mutable_data()[2 * e + 1] = point2D.y;
      images.mutable_data()[e] = image;
      points.mutable_data()[e] = static_cast<int64_t>(k);
    }
  }
  return py::make_tuple(pixels, images, points);
}

// Calls EstimateNoise; arrays about observations are in the order of
// observations().
py::dict Noise(const Model& model, double false_alarm,
               std::vector<double> relative_sigmas) {
  const ModelNoise noise =
      EstimateNoise(model, {false_alarm, std::move(relative_sigmas)}, {});
  const auto count = static_cast<py::ssize_t>(noise.observations.size());
  py::array_t<double> w(count), errors_px({count, py::ssize_t{2}}),
      redundancy({count, py::ssize_t{2}});
  for (py::ssize_t e = 0; e < count; ++e) {
    const ObservationNoise& one = noise.observations[e];
    w.mutable_at(e) = one.w;
    for (py::ssize_t j = 0; j < 2; ++j) {
      errors_px.mutable_at(e, j) = one.error_px[j];
      redundancy.mutable_at(e, j) = one.redundancy[j];
    }
  }
  py::dict result;
  result["sigma_px"] = noise.sigma_px;
  result["cauchy_scale_px"] = noise.cauchy_scale_px;
  result["critical_w"] = noise.critical_w;
  result["w"] = w;
  result["errors_px"] = errors_px;
  result["redundancy"] = redundancy;
  return result;
}

void BindModel(py::module_* module) {
  py::class_<Model, std::shared_ptr<Model>>(*module, "Model")
      .def_static("read", &Read, py::arg("path"), py::kw_only(),
                  py::arg("on_contradiction") = "auto")
      .def_static("from_arrays", &ModelFromArrays, py::arg("observations"),
                  py::arg("image_indices"), py::arg("point_indices"),
                  py::arg("rotations"), py::arg("translations"),
                  py::arg("points"), py::arg("cameras"),
                  py::arg("camera_indices"), py::arg("names"))
      .def("write", &Write, py::arg("path"), py::kw_only(),
           py::arg("output_type") = "BIN", py::arg("overwrite") = false)
      .def_property_readonly("points", &Points)
      .def_property_readonly("colors", &Colors)
      .def_property_readonly("point_ids",
                             [](const Model& model) {
                               return Collect(
                                   model.points3D,
                                   [](const Point3D& p) { return p.id; });
                             })
      .def_property_readonly(
          "image_ids",
          [](const Model& model) {
            return Collect(model.images, [](const Image& i) { return i.id; });
          })
      .def_property_readonly("image_names", &Names)
      .def_property_readonly("rotations", &Rotations)
      .def_property_readonly("translations", &Translations)
      .def_property_readonly("centers", &Centers)
      .def("observations", &Observations)
      .def("pixel_errors",
           [](const Model& model) {
             const std::vector<double> errors = PixelErrors(model);
             return Collect(errors, [](double error) { return error; });
           })
      .def("noise", &Noise, py::kw_only(), py::arg("false_alarm") = 0.05,
           py::arg("relative_sigmas") = std::vector<double>());
}

}  // namespace
}  // namespace krot::internal

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
