#include <string>
#include <vector>

#include "krot/options/solve_options.h"
#include "tools/krot/command.h"
#include "tools/krot/solve_command.h"

namespace krot {
namespace {

// COLMAP's command of this name makes new points from matches.
void RefuseDatabase(OptionParser* parser) {
  for (const char* name : {"database_path", "image_path"}) {
    parser->Add({name,
                 "Refused: this command re-estimates the points that the model "
                 "has and makes no new ones from matches",
                 "left out", "", false, [](const std::string&) -> bool {
                   throw OptionError(
                       "--database_path and --image_path: this command only "
                       "re-estimates the points that the model has; run colmap "
                       "point_triangulator with the same options, and this one "
                       "on its output, without these two");
                 }});
  }
}

}  // namespace

int RunPointTriangulator(const std::vector<std::string>& arguments) {
  SolveCommand command;
  command.name = "point_triangulator";
  command.method_name = "intersection";
  OptionParser parser(command.name,
                      "re-estimates every point of a COLMAP model for the "
                      "lowest largest reprojection error of its track; the "
                      "frames stay");
  AddModelPaths(&command.paths, &parser);
  AddWriteOnInterrupt(&command.paths, &parser);
  AddSolveOptions(&command.options.solve, &command.context, &parser);
  RefuseDatabase(&parser);
  AddCommonOptions(
      "Recorded in the report; this command draws no random "
      "numbers",
      &command.common, &parser);
  if (!parser.Parse(arguments)) {
    PrintTable(command.common.log, parser.Help());
    return kExitDone;
  }
  CheckSolveOptions(command.options.solve, parser);
  command.options.solve = PointsOnly(command.options.solve);
  return RunSolveCommand(command);
}

}  // namespace krot
