#include <string>
#include <vector>

#include "krot/options/command_options.h"
#include "krot/outliers/match_tracks.h"
#include "tools/krot/command.h"
#include "tools/krot/solve_command.h"

namespace krot::internal {
namespace {

// Says why only sweeps are used, where nobody asked for them by name.
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

// Prepares a start from rotations and matches alone: no position of the model
// takes part, and everything moves.
void ResolveDatabase(const OptionParser& parser, SolveCommand* command) {
  if (command->database_path.empty()) return;
  TolerantSolveOptions& options = command->options;
  if (options.solve.init != SolveInit::kFeasible) {
    throw OptionError(
        "--database_path needs --Solver.init feasible: points for the model's "
        "own positions are what krot point_triangulator --database_path makes");
  }
  if (EffectiveMethod(options.solve) != SolveMethod::kAuto ||
      options.solve.norm.p != 2) {
    throw OptionError(
        "--database_path needs --Solver.method auto and --Solver.norm 2");
  }
  parser.RefuseAll(
      {"fixed_images_path", "fixed_points_path", "positions_path",
       "point_positions_path", "Problem.init_max_error", "Solver.finish_slack"},
      "with --database_path, which starts from nothing");
  if (!options.max_error) {
    options.max_error = MatchTracksOptions().max_error_px;
  }
  // The tails of matches are heavy: with true rotations this brings the
  // sample's centres a third nearer to the truth.
  if (!parser.IsGiven("Solver.finish_loss")) {
    options.solve.finish.loss.kind = ErrorLoss::Kind::kCauchy;
  }
  options.solve.init = SolveInit::kModel;
  options.has_start_from_nothing = true;
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
  AddDistancesPath(&command.paths.distances_path, &parser);
  parser.AddPath("database_path", &command.database_path, false, "a file",
                 "With Solver.init feasible: use this database's verified "
                 "matches in place of the model's tracks");
  parser.AddOutputFile("certificate_path", &command.certificate_path,
                       "Where the proof of the lower bound goes, as JSON");
  parser.AddOutputFile("factor_certificate_path",
                       &command.factor_certificate_path,
                       "With Problem.inflate_positions: where the proof goes "
                       "that no smaller factor is enough, as JSON");
  parser.AddOutputFile("conflicts_path", &command.conflicts_path,
                       "With Solver.max_error: where the proof goes of how "
                       "many observations must be left out, as JSON");
  AddSolverOptions(&command.options, &command.context, &parser);
  AddCommonOptions(&command.common, &parser);
  if (!ParseOrPrintHelp(arguments, command.common.log, &parser))
    return kExitDone;
  ResolveSolverOptions(parser, &command.options.solve);
  ResolveDatabase(parser, &command);
  CheckPositionsPath(command.paths, parser);
  ResolveCheckpoint(parser, &command.checkpoint);
  ExplainMethod(command);
  return RunSolveCommand(command);
}

}  // namespace krot::internal
