// krot_benchmark scaling: what `krot solver` costs per observation, from file
// to file, as models grow: in observations, in frames, in length of tracks.

#include <algorithm>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "krot/base/parallel_for.h"
#include "krot/model/model_io.h"
#include "tools/benchmark/benchmark_command.h"
#include "tools/benchmark/benchmark_report.h"
#include "tools/benchmark/process.h"
#include "tools/command_error.h"

namespace krot {
namespace {

// A street: frames one after the other, random tracks.
struct Street {
  int64_t observations = 0;  // about so many
  int64_t frames = 0;
  int64_t track_length = 10;  // mean
};

constexpr int64_t kMillion = 1000000;
constexpr int64_t kObservationsPerFrame = 1000;
constexpr int64_t kSizes[] = {10000, 100000, kMillion, 2 * kMillion,
                              10 * kMillion};
constexpr int kSmallest = 10000;
// While frames or tracks vary, where the largest model is not smaller.
constexpr int64_t kFixedObservations = 200000;
constexpr int64_t kFrames[] = {25, 100, 400, 1600};
constexpr int64_t kTrackLengths[] = {3, 6, 12, 24, 48};
constexpr int64_t kFixedFrames = 200;

struct ScalingOptions {
  BenchmarkOptions common;
  std::string krot_path;
  int max_observations = 1000000;
  int max_joint_observations = 2000000;
  int num_threads = -1;
};

// Seconds are wall clock.
struct Growth {
  std::string method;
  Street street;
  int64_t num_observations = 0;
  double read = 0;
  double solve = 0;
  double write = 0;
  double total = 0;
  int64_t steps = 0;  // sweeps, or iterations of the joint solver
  double seconds_of_steps = 0;
  int64_t peak_bytes = 0;
  int64_t model_bytes = 0;

  double MicrosecondsPerStep() const {
    return 1e6 * seconds_of_steps / static_cast<double>(steps) / Count();
  }
  double Count() const { return static_cast<double>(num_observations); }
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

void Synthesize(const ScalingOptions& options, const Street& street,
                const std::string& path) {
  RunKrot(options, {"model_synthesizer",
                    "--output_path",
                    path,
                    "--overwrite",
                    "1",
                    "--Scene.layout",
                    "street",
                    "--Scene.num_frames",
                    std::to_string(street.frames),
                    "--Scene.num_points",
                    std::to_string(street.observations / street.track_length),
                    "--Scene.track_length",
                    std::to_string(street.track_length),
                    "--Scene.pixel_noise",
                    "1",
                    "--Scene.start_translation_noise",
                    "0.01",
                    "--Scene.start_point_noise",
                    "0.01",
                    "--random_seed",
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

Growth Solve(const ScalingOptions& options, const std::string& method,
             const std::string& model, const ScratchFolder& folder) {
  RunKrot(options,
          {"solver", "--input_path", model, "--output_path", folder / "solved",
           "--overwrite", "1", "--report_path", folder / "report.json",
           "--Solver.method", method, "--Solver.num_threads",
           std::to_string(ResolveNumThreads(options.num_threads))});
  std::ifstream stream(folder / "report.json");
  const auto json = nlohmann::json::parse(stream);
  const auto& seconds = json.at("seconds");
  const auto& steps = json.at(method == "res_int" ? "sweeps" : "iterations");
  Growth growth;
  growth.method = method;
  growth.num_observations = json.at("num_observations");
  growth.read = seconds.at("read");
  growth.solve = seconds.at("solve");
  growth.write = seconds.at("write");
  growth.total = seconds.at("total");
  growth.steps = static_cast<int64_t>(steps.size());
  if (!steps.empty()) growth.seconds_of_steps = steps.back().at("seconds");
  growth.peak_bytes = json.at("peak_memory_bytes");
  return growth;
}

// By sweeps and, up to max_joint_observations, by the joint solver.
void Measure(const ScalingOptions& options, const Street& street,
             std::vector<Growth>* growths) {
  LogLine(options.common.log, 1,
          std::to_string(street.observations) + " observations, " +
              std::to_string(street.frames) + " frames, tracks of " +
              std::to_string(street.track_length));
  const ScratchFolder folder;
  const std::string model = folder / "model";
  Synthesize(options, street, model);
  const int64_t model_bytes = ModelBytes(model);
  for (const char* method : {"res_int", "joint"}) {
    const bool is_joint = method == std::string("joint");
    if (is_joint && street.observations > options.max_joint_observations) {
      continue;
    }
    growths->push_back(Solve(options, method, model, folder));
    growths->back().street = street;
    growths->back().model_bytes = model_bytes;
  }
}

// The time per step by that of the same method on `reference`; missing where
// that was not measured.
Cell RatioTo(const Street& reference, const Growth& growth,
             const std::vector<Growth>& all) {
  for (const Growth& other : all) {
    if (other.method == growth.method &&
        other.street.observations == reference.observations &&
        other.street.frames == reference.frames &&
        other.street.track_length == reference.track_length) {
      return SizedCell(growth.MicrosecondsPerStep() /
                       other.MicrosecondsPerStep());
    }
  }
  return MissingCell();
}

ResultTable ToTable(const std::string& name, const std::string& caption,
                    const Street& reference,
                    const std::vector<Growth>& growths) {
  ResultTable table;
  table.name = name;
  table.caption = caption;
  table.columns = {
      "method",      "frames", "track",     "observations",      "read",
      "solve",       "write",  "in all",    "us in all",         "steps",
      "us per step", "ratio",  "peak (MB)", "B beyond the model"};
  for (const Growth& growth : growths) {
    const double beyond =
        static_cast<double>(growth.peak_bytes - growth.model_bytes);
    table.rows.push_back(
        {TextCell(growth.method), CountCell(growth.street.frames),
         CountCell(growth.street.track_length),
         CountCell(growth.num_observations), SizedCell(growth.read),
         SizedCell(growth.solve), SizedCell(growth.write),
         SizedCell(growth.total),
         SizedCell(1e6 * growth.total / growth.Count()),
         CountCell(growth.steps), SizedCell(growth.MicrosecondsPerStep()),
         RatioTo(reference, growth, growths),
         SizedCell(1e-6 * static_cast<double>(growth.peak_bytes)),
         SizedCell(beyond / growth.Count())});
  }
  return table;
}

LogPlot ToPlot(const std::vector<Growth>& growths) {
  LogPlot plot;
  plot.title = "krot solver, file to file, synthetic streets";
  plot.x_label = "observations";
  plot.y_label = "seconds";
  plot.series = {{"res_int, to its stop rule", {}},
                 {"joint, to a proof", {}},
                 {"1 us per observation", {}}};
  for (const Growth& growth : growths) {
    plot.series[growth.method == "res_int" ? 0 : 1].points.emplace_back(
        growth.Count(), growth.total);
    plot.series[2].points.emplace_back(growth.Count(), 1e-6 * growth.Count());
  }
  return plot;
}

ResultTable MeasureSizes(const ScalingOptions& options, LogPlot* plot) {
  std::vector<Growth> growths;
  const auto street = [](int64_t size) {
    return Street{size, std::max<int64_t>(10, size / kObservationsPerFrame)};
  };
  for (const int64_t size : kSizes) {
    if (size > options.max_observations) break;
    Measure(options, street(size), &growths);
  }
  *plot = ToPlot(growths);
  return ToTable("scaling",
                 "krot solver on synthetic streets, wall-clock seconds; us and "
                 "B are microseconds and bytes per observation, steps are "
                 "sweeps (res_int) or iterations (joint), the ratio is that of "
                 "their time to the row of a million",
                 street(kMillion), growths);
}

ResultTable MeasureFrames(const ScalingOptions& options, int64_t size) {
  std::vector<Growth> growths;
  for (const int64_t frames : kFrames) {
    Measure(options, {size, frames}, &growths);
  }
  return ToTable("scaling_frames",
                 "The same by frames; the ratio is to the fewest",
                 {size, kFrames[0]}, growths);
}

ResultTable MeasureTracks(const ScalingOptions& options, int64_t size) {
  std::vector<Growth> growths;
  for (const int64_t track_length : kTrackLengths) {
    Measure(options, {size, kFixedFrames, track_length}, &growths);
  }
  return ToTable("scaling_tracks",
                 "The same by length of tracks; the ratio is to the shortest",
                 {size, kFixedFrames, kTrackLengths[0]}, growths);
}

BenchmarkReport MeasureAll(const ScalingOptions& options) {
  BenchmarkReport report;
  report.command = "scaling";
  LogPlot plot;
  report.tables.push_back(MeasureSizes(options, &plot));
  report.plot = std::move(plot);
  const int64_t size =
      std::min<int64_t>(kFixedObservations, options.max_observations);
  report.tables.push_back(MeasureFrames(options, size));
  report.tables.push_back(MeasureTracks(options, size));
  return report;
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
                    "The largest model, of up to ten million");
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
  PublishReport(MeasureAll(options), options.common);
  return kExitDone;
}

}  // namespace krot
