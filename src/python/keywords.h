#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <pybind11/pybind11.h>

#include "krot/analysis/model_input.h"
#include "krot/database.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "krot/options/option_table.h"
#include "krot/report/sentences.h"

namespace krot::internal {

// Adds the commands to pykrot._core.
void BindCommands(pybind11::module_* module);

// Sets options from Python's keywords. `relative_gap` means the one option
// whose name behind its group is this; {"Solver.relative_gap": ...} gives the
// whole name. Values may be numbers, bools and strings. Throws OptionError with
// the same sentences as the command line.
void AssignKeywords(const pybind11::dict& keywords, OptionTable* table);

// The command line's files with knowledge beyond the model, as keywords of
// Python.
class KnownFiles {
 public:
  void AddRotationsTo(OptionTable* table);
  void AddFixedTo(OptionTable* table);
  void AddPositionsTo(OptionTable* table);
  void AddDistancesTo(OptionTable* table);
  void AddDatabaseTo(OptionTable* table);

  // The model, or a copy with the rotations of the file. Records what the file
  // changed, and suspicious properties of the poses.
  std::shared_ptr<const Model> WithRotations(
      const std::shared_ptr<Model>& model, RunRecord* run) const;
  FixedParts Fixed(const Model& model) const;
  // Warns of positions that contradict the others, in their own frame.
  KnownPositions Positions(const Model& model) const;
  bool writes_own_frame() const { return output_frame_ == "own"; }
  // With those whose length is only asked for.
  std::vector<KnownDistance> Distances(const Model& model) const;
  // None if no database is given.
  std::optional<Database> Matches(const Model& model) const;

 private:
  std::string rotations_path_;
  std::string fixed_images_path_;
  std::string fixed_points_path_;
  PositionFiles positions_;
  std::string output_frame_ = "model";
  std::string distances_path_;
  std::string database_path_;
};

}  // namespace krot::internal
