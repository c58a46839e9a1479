// krot_benchmark joint: compares the time of `krot solver`, to a certified gap,
// with that of COLMAP's `bundle_adjuster`, from start to exit, on the same
// models in the same run.

#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/parallel_for.h"
#include "tools/benchmark/benchmark_command.h"
#include "tools/benchmark/benchmark_model.h"
#include "tools/benchmark/benchmark_report.h"
#include "tools/benchmark/model_list.h"
#include "tools/benchmark/process.h"
#include "tools/benchmark/timing.h"
#include "tools/krot/command_error.h"

namespace krot::internal {
namespace {

struct JointBenchmarkOptions {
  BenchmarkOptions common;
  std::string krot_path;
  std::string colmap_path = "colmap";
  std::string method = "auto";
  double relative_gap = 1e-4;
  int num_threads = -1;
};

// The contents of krot's report of its last run; errors are true ones, pixels.
struct Proof {
  double cost_before = 0;
  double cost = 0;
  std::optional<double> lower_bound;
  std::optional<double> relative_gap;
  bool is_reached = false;
  size_t rounds = 0;
  size_t iterations = 0;
  size_t support = 0;
};

Proof ReadProof(const std::string& report_path, double relative_gap) {
  std::ifstream stream(report_path);
  const auto json = nlohmann::json::parse(stream);
  Proof proof;
  proof.cost_before = json.at("pixel_error").at("before").at("max");
  proof.cost = json.at("pixel_error").at("after").at("max");
  proof.rounds = json.at("rounds").size();
  proof.iterations = json.at("iterations").size();
  proof.support = json.at("support").size();
  if (json.at("certified").get<bool>()) {
    proof.lower_bound = json.at("lower_bound");
    proof.relative_gap = json.at("relative_gap");
    if (json.at("finish").is_object()) {  // the gap is that before the finish
      const double lowest = json.at("finish").at("lowest_cost");
      proof.relative_gap = (lowest - *proof.lower_bound) / lowest;
    }
    proof.is_reached = *proof.relative_gap <= relative_gap;
  } else {
    proof.is_reached = json.at("termination") == "zero_cost";  // needs no proof
  }
  return proof;
}

// No further round of a model begins after this many seconds.
constexpr double kEnoughSeconds = 10;

Cell CellOr(const std::optional<double>& value, Cell (*cell)(double)) {
  return value ? cell(*value) : MissingCell();
}

Cell PixelCell(double value) { return RealCell(value, 4); }

struct Race {
  std::vector<double> krot_seconds;
  std::vector<double> colmap_seconds;  // empty: it failed
  Proof proof;
};

Race RunRace(const JointBenchmarkOptions& options, const std::string& path) {
  const ScratchFolder folder;
  const std::string threads =
      std::to_string(ResolveNumThreads(options.num_threads));
  const std::vector<std::string> krot = {
      options.krot_path,       "solver",
      "--input_path",          path,
      "--output_path",         folder / "krot",
      "--overwrite",           "1",
      "--log_level",           "0",
      "--report_path",         folder / "report.json",
      "--Solver.method",       options.method,
      "--Solver.relative_gap", NumberText(options.relative_gap),
      "--Solver.num_threads",  threads};
  std::filesystem::create_directory(folder / "colmap");
  const std::vector<std::string> colmap = {
      options.colmap_path, "bundle_adjuster", "--input_path", path,
      "--output_path",     folder / "colmap"};
  Race race;
  const Timer timer;
  for (int repeat = 0; repeat < options.common.repeats; ++repeat) {
    if (timer.Seconds() > kEnoughSeconds) break;
    const ProcessResult ours = RunProcess(krot);
    if (ours.exit_code != kExitDone && ours.exit_code != kExitGivenBack) {
      throw CommandError(kExitInternal,
                         options.krot_path + " solver ended with exit code " +
                             std::to_string(ours.exit_code) + " on " + path);
    }
    race.krot_seconds.push_back(ours.seconds);
    const ProcessResult theirs = RunProcess(colmap);
    if (theirs.exit_code == 0) race.colmap_seconds.push_back(theirs.seconds);
  }
  race.proof = ReadProof(folder / "report.json", options.relative_gap);
  return race;
}

}  // namespace

int RunJointBenchmark(const std::vector<std::string>& arguments) {
  JointBenchmarkOptions options;
  options.common.repeats = 3;
  options.krot_path = SiblingExecutable("krot");
  OptionParser parser = MakeBenchmarkParser(
      "joint", "times krot solver against COLMAP's bundle_adjuster");
  AddBenchmarkOptions(&options.common, &parser);
  parser.AddPath("krot_path", &options.krot_path, false, "an executable",
                 "The krot to run; by default the one beside this program");
  parser.AddPath("colmap_path", &options.colmap_path, false, "an executable",
                 "The colmap to run");
  parser.AddChoice("method", &options.method, {"auto", "joint"},
                   "krot's --Solver.method");
  parser.AddReal("relative_gap", &options.relative_gap, Above(0.0),
                 "The gap to prove");
  parser.AddInteger("num_threads", &options.num_threads, AtLeast(-1),
                    "krot's threads; -1 or 0: all. COLMAP takes all");
  if (!ParseOrPrintHelp(arguments, options.common.log, &parser))
    return kExitDone;
  if (options.common.input_paths.empty()) {
    throw OptionError("--input_path is required");
  }
  CheckReportPaths(options.common);
  ResultTable table;
  table.name = "joint";
  table.caption =
      "Wall-clock seconds, start to exit: krot solver (" + options.method +
      ") to a certified gap of " + NumberText(options.relative_gap) +
      ", and colmap bundle_adjuster; pixels are true ones, the gap is "
      "that before the finish";
  table.columns = {"model",        "observations", "krot",       "colmap",
                   "ratio",        "rounds",       "iterations", "before (px)",
                   "maximum (px)", "bound (px)",   "gap",        "support",
                   "gap reached"};
  std::vector<double> ratios;
  table.notes = MeasureModels(options.common, [&](const std::string& path) {
    const BenchmarkModel model = ReadBenchmarkModel(path);
    const Race race = RunRace(options, path);
    const Proof& proof = race.proof;
    const double ours = MedianOf(race.krot_seconds);
    Cell theirs = MissingCell();
    Cell ratio = MissingCell();
    if (!race.colmap_seconds.empty()) {
      theirs = SizedCell(MedianOf(race.colmap_seconds));
      ratios.push_back(ours / MedianOf(race.colmap_seconds));
      ratio = SizedCell(ratios.back());
    }
    table.rows.push_back({TextCell(model.name),
                          CountCell(static_cast<int64_t>(
                              model.built.problem.observations.size())),
                          SizedCell(ours), theirs, ratio,
                          CountCell(static_cast<int64_t>(proof.rounds)),
                          CountCell(static_cast<int64_t>(proof.iterations)),
                          PixelCell(proof.cost_before), PixelCell(proof.cost),
                          CellOr(proof.lower_bound, PixelCell),
                          CellOr(proof.relative_gap, ScientificCell),
                          CountCell(static_cast<int64_t>(proof.support)),
                          TextCell(proof.is_reached ? "yes" : "no")});
  });
  table.notes.push_back("No round of a model begins more than " +
                        SizedCell(kEnoughSeconds).text + " s after its first.");
  if (!ratios.empty()) {
    table.notes.push_back("Median ratio " + SizedCell(MedianOf(ratios)).text +
                          ".");
  }
  BenchmarkReport report;
  report.command = "joint";
  report.tables = {std::move(table)};
  PublishReport(report, options.common);
  return kExitDone;
}

}  // namespace krot::internal
