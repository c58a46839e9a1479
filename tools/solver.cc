#include <string>
#include <vector>

#include "tools/command.h"
#include "tools/solve_command.h"
#include "tools/solve_options.h"

namespace krot {
namespace {

// The paper's own rule, where its settings are asked for [Zhang18, Sec. 5].
constexpr double kPaperSweepTolerance = 1e-3;

void AddMethod(std::string* method, OptionParser* parser) {
  parser->Add({"Solver.method",
               "res_int: Resection-Intersection sweeps [Zhang18, Alg. 1]",
               "one of {res_int}; no other method exists in this version",
               *method, false, [method](const std::string& text) {
                 *method = text;
                 return text == "res_int";
               }});
}

void AddResIntOptions(ResIntOptions* options, OptionParser* parser) {
  parser->AddInteger("ResInt.max_sweeps", &options->max_sweeps, AtLeast(0),
                     "Sweeps after which to stop in any case");
  parser->Add({"ResInt.sweep_tolerance",
               "Stop when a sweep lowers the cost by less",
               "a number >= 0, relative to the cost",
               NumberText(options->sweep_tolerance) + ", with paper settings " +
                   NumberText(kPaperSweepTolerance),
               false, [options](const std::string& text) {
                 return ParseReal(text, &options->sweep_tolerance) &&
                        options->sweep_tolerance >= 0;
               }});
}

}  // namespace

int RunSolver(const std::vector<std::string>& arguments) {
  SolveCommand command;
  command.name = "solver";
  command.method = "res_int";
  command.solve = &SolveModel;
  OptionParser parser(command.name,
                      "lowers the largest reprojection error of a COLMAP "
                      "model; rotations, intrinsics and the coordinate frame "
                      "stay");
  AddModelPaths(&command.paths, &parser);
  AddMethod(&command.method, &parser);
  AddSolveOptions(&command.options, &parser);
  AddResIntOptions(&command.options.res_int, &parser);
  AddCommonOptions(
      "Recorded in the report; this command draws no random "
      "numbers",
      &command.common, &parser);
  if (!parser.Parse(arguments)) {
    PrintTable(command.common.log, parser.Help());
    return kExitDone;
  }
  CheckSolveOptions(command.options, parser);
  ResIntOptions& res_int = command.options.res_int;
  if (res_int.fast_descent.settings == FastDescentSettings::kPaper &&
      !parser.IsGiven("ResInt.sweep_tolerance")) {
    res_int.sweep_tolerance = kPaperSweepTolerance;
  }
  return RunSolveCommand(command);
}

}  // namespace krot
