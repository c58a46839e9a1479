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
  std::optional<double> position_radius;  // of lines that have none
  std::string report_path;
  std::string html_path;
  bool write_on_interrupt = false;
};

// The output is optional if its meaning is given, as "Where ... goes".
void AddModelPaths(
    ModelPaths* paths, OptionParser* parser,
    const char* output_meaning = nullptr,
    const char* report_meaning = "Where the report goes, as JSON");
// For commands that take other rotations than the model's.
void AddRotationsPath(ModelPaths* paths, OptionParser* parser);
// For commands that can keep images and points fixed.
void AddFixedPaths(ModelPaths* paths, OptionParser* parser);
// For commands that take known positions of cameras and points.
void AddPositionsPath(ModelPaths* paths, OptionParser* parser);
// Throws OptionError for options of positions without positions.
void CheckPositionsPath(const ModelPaths& paths, const OptionParser& parser);
void AddDistancesPath(std::string* path, OptionParser* parser);
// For commands whose estimate is of use before its end.
void AddWriteOnInterrupt(ModelPaths* paths, OptionParser* parser);
void AddOverwrite(bool* overwrite, OptionParser* parser);

// Throws OptionError where the paths contradict each other, ModelError where
// no model lies at input_path, WriteError where the output or a report could
// not be written. Changes nothing and reads no model.
// Returns how to write; keeps a reference to `log`.
WriteModelOptions CheckModelPaths(const ModelPaths& paths,
                                  const LogOptions& log);

// Checks that a file other than the model's, as a report or a certificate, can
// be written to `path`, the value of --`option`; "" stands for none.
// `folder_to_come` will exist by then. Throws OptionError if the name is that
// of one of COLMAP's files, WriteError if it cannot be written.
void CheckSidePath(const std::string& option, const std::string& path,
                   const std::string& folder_to_come = "");

// Ends a command that was interrupted, after it has written its best estimate.
[[noreturn]] void ThrowInterrupted(const ModelPaths& paths);

// What to do where tracks and images contradict each other. Every command that
// reads a model has this option.
void AddOnContradiction(std::string* on_contradiction, OptionParser* parser);

struct ValidModel {
  Model model;
  Contradictions contradictions;  // of the files
  PoseChecks poses;
};

// Reads and validates a model. Warns on stderr of contradictions, and of poses
// that look wrong. Throws ModelError.
ValidModel ReadValidModel(const std::string& path,
                          const std::string& on_contradiction,
                          const LogOptions& log);

// Warns on stderr of poses that look wrong, and says which parts of a valid
// model take no part.
PoseChecks DescribeInput(const std::string& path, const Model& model,
                         const LogOptions& log);

// Reads and validates the model to work on, with the rotations of
// paths.rotations_path if there are some, and fills in what `run` says about
// the input. Throws ModelError, and CommandError if the model has no
// observations but needs some.
Model ReadInput(const ModelPaths& paths, const LogOptions& log, RunRecord* run,
                bool needs_observations = true);

// Warns on stderr if the model is not in COLMAP's conventions, unless rotations
// of paths.rotations_path have replaced its own.
void WarnOfConventions(const ModelPaths& paths, const Model& model,
                       const LogOptions& log);

// Warns on stderr of image names at which COLMAP stumbles in text.
void WarnOfWhiteSpace(const Model& model, const WriteModelOptions& options,
                      const LogOptions& log);

// Writes the model to paths.output_path, with that warning, and to `run` how
// long that took.
void WriteOutput(const Model& model, const ModelPaths& paths,
                 const WriteModelOptions& options, const LogOptions& log,
                 RunRecord* run);

// Checks that --`option`, where a model goes to be looked at, is none of the
// `others`, and can be written to; "" stands for none.
void CheckOwnFolder(const std::string& option, const std::string& path,
                    const std::vector<std::string>& others,
                    const WriteModelOptions& options);

// Warns of a result, which is not the input given back, in which points fit
// only because they have degenerated, and of one whose images' side is worse
// than before, if the model contradicts itself.
void WarnOfDegeneration(const Model& input, const Model& written,
                        const LogOptions& log);

// The images and points of the model that paths.fixed_*_path name. Throws
// ModelError.
FixedParts ReadFixedParts(const ModelPaths& paths, const Model& model,
                          const LogOptions& log);

}  // namespace krot::internal
