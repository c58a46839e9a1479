#include "tools/benchmark/benchmark_model.h"

#include <filesystem>

#include "krot/model.h"
#include "krot/model/model_io.h"
#include "tools/krot/command_error.h"

namespace krot::internal {
namespace {

// "south128" of "models/south128/".
std::string LastPart(const std::string& path) {
  const std::filesystem::path folder =
      (std::filesystem::absolute(path) / "").lexically_normal().parent_path();
  return folder.filename().string();
}

}  // namespace

BenchmarkModel ReadBenchmarkModel(const std::string& path,
                                  int min_track_length) {
  const Model model = ReadModel(path, DetectModelFormat(path));
  ValidateModel(model);
  BuildProblemOptions options;
  options.min_track_length = min_track_length;
  BenchmarkModel result;
  result.name = LastPart(path);
  result.num_images = static_cast<int64_t>(model.images.size());
  result.built = BuildProblem(model, options);
  if (result.built.problem.observations.empty()) {
    throw CommandError(kExitNothingToSolve,
                       path + " has no observations to optimise");
  }
  return result;
}

}  // namespace krot::internal
