#include "python/keywords.h"

#include "krot/analysis/model_input.h"
#include "krot/model/model_io.h"
#include "krot/report/reports.h"

namespace krot::internal {
namespace {

namespace py = pybind11;

std::string TextOf(const py::handle& value) {
  if (py::isinstance<py::bool_>(value)) return value.cast<bool>() ? "1" : "0";
  return py::str(value);
}

// The option that the keyword means. If there is none, the keyword itself, so
// that the table reports what is wrong with it.
std::string FullName(const std::string& keyword, const OptionTable& table) {
  std::string found;
  for (const Option& option : table.options()) {
    const size_t dot = option.name.find('.');
    if (dot == std::string::npos || option.name.substr(dot + 1) != keyword) {
      continue;
    }
    if (!found.empty()) {
      throw OptionError(keyword + " may be " + found + " or " + option.name +
                        ": give the whole name in `options`");
    }
    found = option.name;
  }
  return found.empty() ? keyword : found;
}

// Raises a Python warning, for example about lines whose names the model does
// not have.
void Warn(const std::string& sentence) {
  if (PyErr_WarnEx(PyExc_UserWarning, sentence.c_str(), 1) != 0) {
    throw py::error_already_set();
  }
}

void AddFile(const std::string& name, std::string* path, OptionTable* table) {
  table->Add({name, "", "a file", "", false, [path](const std::string& text) {
                *path = text;
                return !text.empty();
              }});
}

}  // namespace

void AssignKeywords(const py::dict& keywords, OptionTable* table) {
  std::vector<OptionAssignment> assignments;
  for (const auto& [key, value] : keywords) {
    const std::string name = FullName(py::str(key), *table);
    assignments.push_back({name, TextOf(value), name});
  }
  table->Assign(assignments);
  table->RequireAll();
}

void KnownFiles::AddRotationsTo(OptionTable* table) {
  AddFile("rotations_path", &rotations_path_, table);
}

void KnownFiles::AddFixedTo(OptionTable* table) {
  AddFile("fixed_images_path", &fixed_images_path_, table);
  AddFile("fixed_points_path", &fixed_points_path_, table);
}

void KnownFiles::AddPositionsTo(OptionTable* table) {
  AddFile("positions_path", &positions_.of_cameras, table);
  AddFile("point_positions_path", &positions_.of_points, table);
  table->Add({"Problem.position_radius", "", "a number > 0", "", false,
              [this](const std::string& text) {
                positions_.radius.emplace();
                return ParseReal(text, &*positions_.radius) &&
                       *positions_.radius > 0;
              }});
  table->Add({"positions_frame", "", "one of {model, own}", "model", false,
              [this](const std::string& text) {
                positions_.have_own_frame = text == "own";
                return text == "own" || text == "model";
              }});
  table->AddChoice("output_frame", &output_frame_, {"model", "own"}, "");
}

void KnownFiles::AddDistancesTo(OptionTable* table) {
  AddFile("distances_path", &distances_path_, table);
}

void KnownFiles::AddDatabaseTo(OptionTable* table) {
  AddFile("database_path", &database_path_, table);
}

std::shared_ptr<const Model> KnownFiles::WithRotations(
    const std::shared_ptr<Model>& model, RunRecord* run) const {
  run->poses = CheckPoses(*model);
  if (rotations_path_.empty()) return model;
  auto turned = std::make_shared<Model>(*model);
  run->rotations =
      TakeRotations(ReadFileBytes(rotations_path_), turned.get(), -1, &Warn);
  return turned;
}

std::optional<Database> KnownFiles::Matches(const Model& model) const {
  if (database_path_.empty()) return std::nullopt;
  return ReadDatabase(database_path_, model, &Warn);
}

FixedParts KnownFiles::Fixed(const Model& model) const {
  FixedParts fixed;
  if (!fixed_images_path_.empty()) {
    fixed.frames = FixedFrames(ReadFileBytes(fixed_images_path_), model, &Warn);
  }
  if (!fixed_points_path_.empty()) {
    fixed.points3D =
        FixedPoints3D(ReadFileBytes(fixed_points_path_), model, &Warn);
  }
  return fixed;
}

std::vector<KnownDistance> KnownFiles::Distances(const Model& model) const {
  if (distances_path_.empty()) return {};
  return ReadDistances(ReadFileBytes(distances_path_), model,
                       /*may_lack_metres=*/true, &Warn);
}

KnownPositions KnownFiles::Positions(const Model& model) const {
  if (writes_own_frame() && !positions_.have_own_frame) {
    throw OptionError(
        "output_frame has no effect without positions_frame='own'");
  }
  if (positions_.have_own_frame && positions_.of_cameras.empty() &&
      positions_.of_points.empty()) {
    throw OptionError(
        "positions_frame has no effect without positions_path or "
        "point_positions_path");
  }
  KnownPositions known = ReadKnownPositions(positions_, model, &Warn);
  if (!known.frame) return known;
  for (const WrongPosition& wrong : known.frame->wrong) {
    Warn(WrongPositionSentence(wrong));
  }
  return known;
}

}  // namespace krot::internal
