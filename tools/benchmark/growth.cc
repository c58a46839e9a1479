#include "tools/benchmark/growth.h"

#include <fstream>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "krot/model/model_io.h"
#include "tools/krot/command_error.h"

namespace krot::internal {
namespace {

void RunKrot(const KrotRun& run, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), run.krot_path);
  arguments.insert(arguments.end(), {"--log_level", "0"});
  const ProcessResult result = RunProcess(arguments);
  if (result.exit_code == kExitDone) return;
  throw CommandError(kExitInternal, run.krot_path + " " + arguments[1] +
                                        " ended with exit code " +
                                        std::to_string(result.exit_code));
}

// The memory of a loaded model: the contents of its lists only.
int64_t ModelBytes(const std::string& path) {
  const Model model = ReadModel(path, DetectModelFormat(path));
  size_t bytes = model.points3D.size() * sizeof(Point3D) +
                 model.track_elements.size() * sizeof(TrackElement);
  for (const Image& image : model.images) {
    bytes += sizeof(Image) + image.points2D.size() * sizeof(Point2D);
  }
  return static_cast<int64_t>(bytes);
}

}  // namespace

void SynthesizeStreet(const KrotRun& run, const Street& street,
                      const std::string& model) {
  std::vector<std::string> arguments = {"model_synthesizer"};
  const auto add = [&](const char* option, const std::string& value) {
    arguments.insert(arguments.end(), {option, value});
  };
  add("--output_path", model);
  add("--overwrite", "1");
  add("--Scene.layout", "street");
  add("--Scene.num_frames", std::to_string(street.frames));
  add("--Scene.num_points",
      std::to_string(street.observations / street.track_length));
  add("--Scene.track_length", std::to_string(street.track_length));
  add("--Scene.pixel_noise", "1");
  add("--Scene.start_translation_noise", "0.01");
  add("--Scene.start_point_noise", "0.01");
  add("--random_seed", std::to_string(run.random_seed));
  RunKrot(run, std::move(arguments));
}

Growth MeasureStreet(const KrotRun& run, const std::string& method,
                     const Street& street, const std::string& model,
                     const ScratchFolder& folder) {
  std::vector<std::string> arguments = {"solver",
                                        "--input_path",
                                        model,
                                        "--output_path",
                                        folder / "solved",
                                        "--overwrite",
                                        "1",
                                        "--report_path",
                                        folder / "report.json",
                                        "--Solver.method",
                                        method,
                                        "--Solver.num_threads",
                                        std::to_string(run.num_threads)};
  if (method == "res_int") {
    arguments.insert(arguments.end(),
                     {"--ResInt.max_sweeps", std::to_string(run.max_sweeps)});
  }
  RunKrot(run, std::move(arguments));
  std::ifstream stream(folder / "report.json");
  const auto json = nlohmann::json::parse(stream);
  const auto& seconds = json.at("seconds");
  const auto& steps = json.at(method == "res_int" ? "sweeps" : "iterations");
  Growth growth;
  growth.method = method;
  growth.street = street;
  growth.num_observations = json.at("num_observations");
  growth.read = seconds.at("read");
  growth.solve = seconds.at("solve");
  growth.write = seconds.at("write");
  growth.total = seconds.at("total");
  growth.is_cut = json.at("termination") == "max_sweeps";
  growth.steps = static_cast<int64_t>(steps.size());
  if (!steps.empty()) growth.seconds_of_steps = steps.back().at("seconds");
  growth.peak_bytes = json.at("peak_memory_bytes");
  growth.model_bytes = ModelBytes(model);
  return growth;
}

}  // namespace krot::internal
