// krot_benchmark scaling: what `krot solver` costs per observation, from file
// to file, as models grow.

#include <algorithm>
#include <fstream>
#include <string>
#include <vector>

#include "krot/base/parallel_for.h"
#include "krot/model/model_io.h"
#include "tools/benchmark/benchmark_command.h"
#include "tools/benchmark/benchmark_report.h"
#include "tools/benchmark/process.h"
#include "tools/command_error.h"

namespace krot {
namespace {

constexpr int kTrackLength = 10;
constexpr int kObservationsPerFrame = 1000;
constexpr int kSmallest = 10000;  // observations

struct ScalingOptions {
  BenchmarkOptions common;
  std::string krot_path;
  int max_observations = 1000000;
  int max_joint_observations = 100000;
  int num_threads = -1;
};

void RunKrot(const ScalingOptions& options,
             std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), options.krot_path);
  arguments.insert(arguments.end(), {"--log_level", "0"});
  const ProcessResult result = RunProcess(arguments);
  if (result.exit_code == kExitDone) return;
  throw CommandError(kExitInternal, options.krot_path + " " + arguments[1] +
                                        " ended with exit code " +
                                        std::to_string(result.exit_code));
}

// A street of about `count` observations: every frame sees a thousand.
void Synthesize(const ScalingOptions& options, int count,
                const std::string& path) {
  RunKrot(options,
          {"model_synthesizer", "--output_path", path, "--Scene.layout",
           "street", "--Scene.num_frames",
           std::to_string(std::max(10, count / kObservationsPerFrame)),
           "--Scene.num_points", std::to_string(count / kTrackLength),
           "--Scene.track_length", std::to_string(kTrackLength),
           "--Scene.pixel_noise", "1", "--Scene.start_translation_noise",
           "0.01", "--Scene.start_point_noise", "0.01", "--random_seed",
           std::to_string(options.common.random_seed)});
}

// What a loaded model occupies, its lists' contents alone.
int64_t ModelBytes(const std::string& path) {
  const Model model = ReadModel(path, DetectModelFormat(path));
  size_t bytes = model.points3D.size() * sizeof(Point3D) +
                 model.track_elements.size() * sizeof(TrackElement);
  for (const Image& image : model.images) {
    bytes += sizeof(Image) + image.points2D.size() * sizeof(Point2D);
  }
  return static_cast<int64_t>(bytes);
}

std::vector<Cell> Measure(const ScalingOptions& options,
                          const std::string& method, const std::string& model,
                          const ScratchFolder& folder, int64_t model_bytes) {
  RunKrot(options,
          {"solver", "--input_path", model, "--output_path", folder / "solved",
           "--overwrite", "1", "--report_path", folder / "report.json",
           "--Solver.method", method, "--Solver.num_threads",
           std::to_string(ResolveNumThreads(options.num_threads))});
  std::ifstream stream(folder / "report.json");
  const auto json = nlohmann::json::parse(stream);
  const auto& seconds = json.at("seconds");
  const auto& sweeps = json.at("sweeps");
  const double count = json.at("num_observations");
  const double total = seconds.at("total");
  const int64_t peak = json.at("peak_memory_bytes");
  const Cell per_sweep =
      method == "res_int" && !sweeps.empty()
          ? SizedCell(1e6 * sweeps.back().at("seconds").get<double>() /
                      (static_cast<double>(sweeps.size()) * count))
          : MissingCell();
  return {TextCell(method),
          CountCell(json.at("num_frames")),
          CountCell(json.at("num_observations")),
          SizedCell(seconds.at("read")),
          SizedCell(seconds.at("build")),
          SizedCell(seconds.at("solve")),
          SizedCell(seconds.at("write")),
          SizedCell(1e6 * total / count),
          CountCell(static_cast<int64_t>(sweeps.size())),
          per_sweep,
          SizedCell(static_cast<double>(peak) / count),
          SizedCell(static_cast<double>(peak - model_bytes) / count)};
}

}  // namespace

int RunScalingBenchmark(const std::vector<std::string>& arguments) {
  ScalingOptions options;
  options.common.repeats = 1;
  options.krot_path = SiblingExecutable("krot");
  OptionParser parser = MakeBenchmarkParser(
      "scaling", "times krot solver on ever larger synthetic models");
  AddBenchmarkOptions(&options.common, &parser);
  parser.AddPath("krot_path", &options.krot_path, false, "an executable",
                 "The krot to run; by default the one beside this program");
  parser.AddInteger("max_observations", &options.max_observations,
                    AtLeast(kSmallest),
                    "The largest model; they grow tenfold from 10000");
  parser.AddInteger("max_joint_observations", &options.max_joint_observations,
                    AtLeast(0), "Method joint does not run on more");
  parser.AddInteger("num_threads", &options.num_threads, AtLeast(-1),
                    "krot's threads; -1 or 0: all");
  if (!parser.Parse(arguments)) {
    PrintTable(options.common.log, parser.Help());
    return kExitDone;
  }
  if (!options.common.input_paths.empty()) {
    throw OptionError("scaling measures synthetic models only");
  }
  CheckReportPaths(options.common);
  ResultTable table;
  table.name = "scaling";
  table.caption =
      "krot solver on synthetic streets: wall-clock seconds, "
      "microseconds and bytes per observation (us, B)";
  table.columns = {"method",       "frames",    "observations",
                   "read",         "build",     "solve",
                   "write",        "us in all", "sweeps",
                   "us per sweep", "B at most", "B beyond the model"};
  const ScratchFolder folder;
  for (int64_t count = kSmallest; count <= options.max_observations;
       count *= 10) {
    LogLine(options.common.log, 1, std::to_string(count) + " observations");
    const std::string model = folder / std::to_string(count);
    Synthesize(options, static_cast<int>(count), model);
    const int64_t model_bytes = ModelBytes(model);
    table.rows.push_back(
        Measure(options, "res_int", model, folder, model_bytes));
    if (count > options.max_joint_observations) continue;
    table.rows.push_back(Measure(options, "joint", model, folder, model_bytes));
  }
  BenchmarkReport report;
  report.command = "scaling";
  report.tables = {std::move(table)};
  PublishReport(report, options.common);
  return kExitDone;
}

}  // namespace krot
