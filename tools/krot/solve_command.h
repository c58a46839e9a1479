#pragma once

#include <functional>
#include <string>

#include "krot/pipeline/solve_model.h"
#include "tools/krot/common_options.h"
#include "tools/krot/model_files.h"

namespace krot {

// What `solver` and `point_triangulator` have in common: check the paths,
// read, solve, write, report.
struct SolveCommand {
  std::string name;
  std::string method_name;  // for the report; "": that of the solve
  ModelPaths paths;
  std::string certificate_path;  // "": not wanted
  CommonOptions common;
  SolveModelOptions options;  // its callbacks are set by the run
  Context context;            // likewise, and the flag
  SolveModelResult (*solve)(const Model&, const SolveModelOptions&,
                            const Context&) = nullptr;
};

// Returns an exit code or throws; nothing is written unless all went well.
int RunSolveCommand(const SolveCommand& command);

}  // namespace krot
