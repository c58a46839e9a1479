#pragma once

#include <functional>
#include <string>

#include "krot/outliers/outlier_filter.h"
#include "tools/krot/checkpoint.h"
#include "tools/krot/common_options.h"
#include "tools/krot/model_files.h"

namespace krot::internal {

// What `solver` and `point_triangulator` have in common: they check the paths,
// read, solve, write and report.
struct SolveCommand {
  std::string name;
  std::string method_name;  // for the report; "": that of the solve
  ModelPaths paths;
  std::string certificate_path;         // "": not wanted
  std::string conflicts_path;           // "": not wanted
  std::string factor_certificate_path;  // "": not wanted
  // "": the model's tracks are used. Otherwise positions and points are made
  // from this database's matches and the model's rotations, and the solve
  // starts there.
  std::string database_path;
  CheckpointOptions checkpoint;
  CommonOptions common;
  TolerantSolveOptions options;  // its callbacks are set by the run
  Context context;               // likewise, and so is the flag

  // For several processes that solve the model together (tools/krot_mpi): read
  // gives the model or this process's part of it, take_share the part that this
  // process solves; join puts the whole together, as it was read and as it is
  // solved, in the process that writes it. Empty: this process has it all.
  std::function<Model(RunRecord* run)> read;
  std::function<Model(Model read)> take_share;
  std::function<bool(Model* model, Model* solved, SolveSummary* summary)> join;
};

// Returns an exit code or throws. Nothing is written before the solve is done;
// then the model, the certificate, the report and the page are, each whole or
// not at all. If one cannot be written, those before it stay. If there is no
// start, only the certificate is written, and only if it proves that there is
// none.
int RunSolveCommand(const SolveCommand& command);

}  // namespace krot::internal
