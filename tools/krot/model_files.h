#pragma once

#include <optional>
#include <string>
#include <vector>

#include "krot/model.h"
#include "krot/model/model_checks.h"
#include "krot/model/model_io.h"
#include "krot/report/sentences.h"
#include "tools/krot/log.h"
#include "tools/krot/option_parser.h"

namespace krot::internal {

// The paths of a command that reads a model and writes one.
struct ModelPaths {
  std::string input_path;
  std::string output_path;
  std::string output_type = "auto";
  bool overwrite = false;
  std::string on_contradiction = "auto";
  std::string rotations_path;     // "": the model's own
  std::string fixed_images_path;  // "": all move
  std::string fixed_points_path;  // "": all move
  std::string positions_path;     // "": none is known
  std::string point_positions_path;
  std::string distances_path;  // "": none is known
  std::string positions_frame = "model";
  std::string output_frame = "model";
  std::optional<double> position_radius;  // of lines without one
  std::string report_path;
  std::string html_path;
  bool write_on_interrupt = false;
};

// The output is required unless its meaning is given: "Where ... goes".
void AddModelPaths(
    ModelPaths* paths, OptionParser* parser,
    const char* output_meaning = nullptr,
    const char* report_meaning = "Where the report goes, as JSON");
// Of a command that takes other rotations than the model's.
void AddRotationsPath(ModelPaths* paths, OptionParser* parser);
// Of a command that may hold images and points.
void AddFixedPaths(ModelPaths* paths, OptionParser* parser);
// Of a command that keeps cameras within a radius of where they are known to
// be.
void AddPositionsPath(ModelPaths* paths, OptionParser* parser);
void AddDistancesPath(std::string* path, OptionParser* parser);
// Of a command whose estimate is of use before its end.
void AddWriteOnInterrupt(ModelPaths* paths, OptionParser* parser);
void AddOverwrite(bool* overwrite, OptionParser* parser);

// Throws OptionError where the paths contradict each other, ModelError where
// no model lies at input_path, WriteError where the output or a report could
// not be written. Changes nothing and reads no model.
// Returns how to write; keeps a reference to `log`.
WriteModelOptions CheckModelPaths(const ModelPaths& paths,
                                  const LogOptions& log);

// Whether a file beside the model, a report or a certificate, can be written to
// `path`, the value of --`option`; "": none is. `folder_to_come` will exist by
// then. Throws OptionError if it would take the place of one of COLMAP's files,
// WriteError if it cannot be written.
void CheckSidePath(const std::string& option, const std::string& path,
                   const std::string& folder_to_come = "");

// Ends a command that was interrupted and has written what it had by then.
[[noreturn]] void ThrowInterrupted(const ModelPaths& paths);

// What to do where tracks and images contradict each other; every command that
// reads a model asks.
void AddOnContradiction(std::string* on_contradiction, OptionParser* parser);

struct ValidModel {
  Model model;
  Contradictions contradictions;  // that the files hold
  PoseChecks poses;
};

// Reads and validates, and tells on stderr of contradictions and of what is odd
// about the poses. Throws ModelError.
ValidModel ReadValidModel(const std::string& path,
                          const std::string& on_contradiction,
                          const LogOptions& log);

// The model to work on: read and validated, with the rotations of
// paths.rotations_path, if there is one; fills in what `run` says of the
// input. Throws ModelError, and CommandError for a model without observations
// if it needs some.
Model ReadInput(const ModelPaths& paths, const LogOptions& log, RunRecord* run,
                bool needs_observations = true);

// Of a result that is not given back: points that fit only as they have
// degenerated, and, of a model that contradicts itself, an images' side that
// is worse than it was.
void WarnOfDegeneration(const Model& input, const Model& written,
                        const LogOptions& log);

// What paths.fixed_*_path name of the model. Throws ModelError.
FixedParts ReadFixedParts(const ModelPaths& paths, const Model& model,
                          const LogOptions& log);

}  // namespace krot::internal
