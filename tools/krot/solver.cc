#include <optional>
#include <string>
#include <vector>

#include "krot/options/solver_options.h"
#include "tools/krot/command.h"
#include "tools/krot/solve_command.h"

namespace krot::internal {
namespace {

// Why sweeps alone, where nobody asked for them by name.
void ExplainMethod(const SolveCommand& command) {
  const SolveModelOptions& options = command.options.solve;
  if (options.method == EffectiveMethod(options)) return;
  const bool is_paper =
      options.res_int.fast_descent.settings == FastDescentSettings::kPaper;
  LogLine(command.common.log, 1,
          is_paper ? "paper settings: sweeps alone, without a bound"
                   : "this norm has no joint solver: sweeps alone, without a "
                     "bound");
}

}  // namespace

int RunSolver(const std::vector<std::string>& arguments) {
  SolveCommand command;
  command.name = "solver";
  OptionParser parser(command.name,
                      "finds the lowest largest reprojection error of a COLMAP "
                      "model, and proves it; rotations, intrinsics and the "
                      "coordinate frame stay");
  AddModelPaths(&command.paths, &parser);
  AddWriteOnInterrupt(&command.paths, &parser);
  AddCheckpointPath(&command.checkpoint, &parser);
  AddCheckpointOnly(&command.checkpoint, &parser);
  AddRotationsPath(&command.paths, &parser);
  AddFixedPaths(&command.paths, &parser);
  AddPositionsPath(&command.paths, &parser);
  parser.AddOutputFile("certificate_path", &command.certificate_path,
                       "Where the proof of the lower bound goes, as JSON; see "
                       "certificate_checker");
  parser.AddOutputFile("factor_certificate_path",
                       &command.factor_certificate_path,
                       "With Problem.inflate_positions: where the proof goes "
                       "that no smaller factor is enough, as JSON");
  parser.AddOutputFile("conflicts_path", &command.conflicts_path,
                       "With Solver.max_error: where the proof goes of how "
                       "many observations must be left out, as JSON; it takes "
                       "most of the time");
  AddSolverOptions(&command.options, &command.context, &parser);
  AddCommonOptions(
      "Recorded in the report; this command draws no random "
      "numbers",
      &command.common, &parser);
  if (!parser.Parse(arguments)) {
    PrintTable(command.common.log, parser.Help());
    return kExitDone;
  }
  ResolveSolverOptions(parser, &command.options.solve);
  ResolveCheckpoint(parser, &command.checkpoint);
  ExplainMethod(command);
  return RunSolveCommand(command);
}

}  // namespace krot::internal
