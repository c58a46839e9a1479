#pragma once

#include <functional>
#include <string>

#include "krot/outliers/filter_steps.h"
#include "tools/krot/checkpoint.h"
#include "tools/krot/common_options.h"
#include "tools/krot/model_files.h"

namespace krot::internal {

// What `solver` and `point_triangulator` have in common: check the paths,
// read, solve, write, report.
struct SolveCommand {
  std::string name;
  std::string method_name;  // for the report; "": that of the solve
  ModelPaths paths;
  std::string certificate_path;         // "": not wanted
  std::string conflicts_path;           // "": not wanted
  std::string factor_certificate_path;  // "": not wanted
  // "": the model's tracks. Else positions and points come from this database's
  // matches and the model's rotations, and the solve starts there.
  std::string database_path;
  CheckpointOptions checkpoint;
  CommonOptions common;
  TolerantSolveOptions options;  // its callbacks are set by the run
  Context context;               // likewise, and the flag

  // Where several processes solve the model together (tools/krot_mpi): what
  // this one takes of it; and, of the one that writes, the whole as it was read
  // and as it is solved. Empty: this one has it all.
  std::function<Model(const Model& whole)> take_share;
  std::function<bool(Model* model, Model* solved, SolveSummary* summary)> join;
};

// Returns an exit code or throws. Nothing is written before the solve is done:
// then the model, the certificate, the report and the page, each whole or not
// at all. Where one cannot be written those before it stay. Without a start
// there is the certificate alone, if it is proved that there is none.
int RunSolveCommand(const SolveCommand& command);

}  // namespace krot::internal
