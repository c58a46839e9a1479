// krot_benchmark positioning: finds a model's positions from its rotations and
// tracks by the rival's method, for raw_tracks.py.

#include <string>
#include <vector>

#include "krot/convert/build_problem.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "tools/benchmark/benchmark_command.h"
#include "tools/benchmark/rivals/bearing_positions.h"
#include "tools/krot/command_error.h"
#include "tools/krot/log.h"
#include "tools/krot/option_parser.h"

namespace krot::internal {

int RunPositioningBenchmark(const std::vector<std::string>& arguments) {
  std::string input_path, output_path;
  int random_seed = 0;
  BearingPositionsOptions options;
  OptionParser parser("positioning",
                      "positions from rotations and tracks by robust least "
                      "squares on bearings, from random positions",
                      "krot_benchmark");
  parser.AddPath("input_path", &input_path, true, "a folder",
                 "The COLMAP model; its translations and points do not count");
  parser.AddPath("output_path", &output_path, true, "a folder",
                 "Where the model goes; what is there is replaced");
  parser.AddInteger("random_seed", &random_seed, AtLeast(0),
                    "Of the random positions");
  parser.AddThreads("num_threads", &options.num_threads, "of Ceres");
  if (!parser.Parse(arguments)) {
    PrintTable({}, parser.Help());
    return kExitDone;
  }
  options.random_seed = static_cast<uint64_t>(random_seed);
  const Model model = ReadModel(input_path, DetectModelFormat(input_path));
  ValidateModel(model);
  BuildProblemOptions build;
  build.ignore_translations = true;
  const BuiltProblem built = BuildProblem(model, build);
  WriteModelOptions write;
  write.overwrite = true;
  WriteModel(
      ApplyEstimate(model, built, PositionByBearings(built.problem, options)),
      output_path, write);
  return kExitDone;
}

}  // namespace krot::internal
