// krot_benchmark scaling: the cost of `krot solver` per observation, from file
// to file, as models grow in observations, frames, and length of tracks.

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "krot/base/parallel_for.h"
#include "tools/benchmark/benchmark_command.h"
#include "tools/benchmark/benchmark_report.h"
#include "tools/benchmark/growth.h"
#include "tools/benchmark/process.h"
#include "tools/krot/command_error.h"

namespace krot::internal {
namespace {

constexpr int64_t kMillion = 1000000;
constexpr int64_t kObservationsPerFrame = 1000;
constexpr int64_t kSizes[] = {10000, 100000, kMillion, 2 * kMillion,
                              10 * kMillion};
constexpr int kSmallest = 10000;
// The number of observations while frames or tracks vary, unless the largest
// model is smaller.
constexpr int64_t kFixedObservations = 200000;
constexpr int64_t kFrames[] = {25, 100, 400, 1600};
constexpr int64_t kTrackLengths[] = {3, 6, 12, 24, 48};
constexpr int64_t kFixedFrames = 200;

struct ScalingOptions {
  BenchmarkOptions common;
  std::string krot_path;
  int max_observations = 1000000;
  int max_joint_observations = 2000000;
  bool vary = true;  // also vary frames and tracks
  int max_sweeps = 1000;
  int num_threads = -1;
};

// Measures sweeps and, up to max_joint_observations, the joint solver.
void Measure(const ScalingOptions& options, const Street& street,
             std::vector<Growth>* growths) {
  LogLine(options.common.log, 1,
          std::to_string(street.observations) + " observations, " +
              std::to_string(street.frames) + " frames, tracks of " +
              std::to_string(street.track_length));
  const KrotRun run = {options.krot_path,
                       ResolveNumThreads(options.num_threads),
                       options.max_sweeps, options.common.random_seed};
  const ScratchFolder folder;
  const std::string model = folder / "model";
  SynthesizeStreet(run, street, model);
  growths->push_back(MeasureStreet(run, "res_int", street, model, folder));
  if (street.observations > options.max_joint_observations) return;
  growths->push_back(MeasureStreet(run, "joint", street, model, folder));
}

// The time per step, divided by that of the same method on `reference`; missing
// if that was not measured.
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
  table.notes = {"* the limit of sweeps: the stop rule was not reached."};
  for (const Growth& growth : growths) {
    Cell steps = CountCell(growth.steps);
    if (growth.is_cut) steps.text += " *";
    const double beyond =
        static_cast<double>(growth.peak_bytes - growth.model_bytes);
    table.rows.push_back(
        {TextCell(growth.method), CountCell(growth.street.frames),
         CountCell(growth.street.track_length),
         CountCell(growth.num_observations), SizedCell(growth.read),
         SizedCell(growth.solve), SizedCell(growth.write),
         SizedCell(growth.total),
         SizedCell(1e6 * growth.total / growth.Count()), std::move(steps),
         SizedCell(growth.MicrosecondsPerStep()),
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
  if (!options.vary) return report;
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
  parser.AddInteger("max_sweeps", &options.max_sweeps, AtLeast(1),
                    "Where sweeps end that do not stop before");
  parser.AddBool("vary", &options.vary,
                 "Also models of one size with ever more frames, and with "
                 "ever longer tracks");
  parser.AddInteger("num_threads", &options.num_threads, AtLeast(-1),
                    "krot's threads; -1 or 0: all");
  if (!ParseOrPrintHelp(arguments, options.common.log, &parser))
    return kExitDone;
  if (!options.common.input_paths.empty()) {
    throw OptionError("scaling measures synthetic models only");
  }
  CheckReportPaths(options.common);
  PublishReport(MeasureAll(options), options.common);
  return kExitDone;
}

}  // namespace krot::internal
