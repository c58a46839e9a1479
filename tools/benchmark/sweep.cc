// krot_benchmark sweep: the cost of a sweep per observation, with `paper` and
// with `fast` settings, compared with one pass over the data, and the speed-up
// by more threads.

#include <string>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/parallel_for.h"
#include "krot/problem/cost.h"
#include "krot/sweeps/res_int.h"
#include "tools/benchmark/benchmark_command.h"
#include "tools/benchmark/benchmark_report.h"
#include "tools/benchmark/model_list.h"
#include "tools/benchmark/synthetic_model.h"
#include "tools/benchmark/timing.h"
#include "tools/krot/command_error.h"

namespace krot::internal {
namespace {

constexpr int kSweeps = 10;

struct SweepOptions {
  BenchmarkOptions common;
  int num_threads = -1;
  int synthetic_size = 5;  // UWO
  int max_paper_observations = 400000;
};

// Microseconds per observation and sweep, one number per round.
struct SweepTimes {
  std::vector<double> paper;    // one thread; one round, or none
  std::vector<double> fast;     // one thread
  std::vector<double> threads;  // fast, all threads
  std::vector<double> floor;    // one pass over the residuals, one thread
  double paper_cost = 0;        // pixels, after the same number of sweeps
  double fast_cost = 0;
};

double MicrosecondsPerSweep(const BenchmarkModel& model,
                            FastDescentSettings settings, int num_threads,
                            double* cost) {
  ResIntOptions options;
  options.fast_descent.settings = settings;
  options.max_sweeps = kSweeps;
  options.sweep_tolerance = 0;
  options.patience = kSweeps;
  Estimate estimate = model.built.start;
  const ResIntSummary summary =
      SolveResInt(model.built.problem, options, {num_threads}, &estimate);
  *cost = summary.cost_final;
  return 1e6 * summary.sweeps.back().seconds /
         static_cast<double>(summary.sweeps.size() *
                             model.built.problem.observations.size());
}

double MicrosecondsPerPass(const BenchmarkModel& model) {
  constexpr int kPasses = 5;
  const Timer timer;
  double sum = 0;
  for (int pass = 0; pass < kPasses; ++pass) {
    sum += Cost(model.built.problem, model.built.start, Norm::L2(), 1);
  }
  // Uses `sum`, so that the compiler does not remove the loop.
  const double seconds = sum > 0 ? timer.Seconds() : 0;
  return 1e6 * seconds / kPasses /
         static_cast<double>(model.built.problem.observations.size());
}

SweepTimes Measure(const SweepOptions& options, const BenchmarkModel& model) {
  const int threads = ResolveNumThreads(options.num_threads);
  const int64_t count =
      static_cast<int64_t>(model.built.problem.observations.size());
  SweepTimes times;
  for (int repeat = 0; repeat < options.common.repeats; ++repeat) {
    times.fast.push_back(MicrosecondsPerSweep(model, FastDescentSettings::kFast,
                                              1, &times.fast_cost));
    times.threads.push_back(MicrosecondsPerSweep(
        model, FastDescentSettings::kFast, threads, &times.fast_cost));
    times.floor.push_back(MicrosecondsPerPass(model));
    if (repeat > 0 || count > options.max_paper_observations) continue;
    times.paper.push_back(MicrosecondsPerSweep(
        model, FastDescentSettings::kPaper, 1, &times.paper_cost));
  }
  return times;
}

std::vector<Cell> Row(const BenchmarkModel& model, const SweepTimes& times) {
  const double fast = MedianOf(times.fast);
  std::vector<Cell> row = {
      TextCell(model.name),
      CountCell(static_cast<int64_t>(model.built.problem.observations.size())),
      SizedCell(fast)};
  if (times.paper.empty()) {
    row.insert(row.end(), 2, MissingCell());
  } else {
    row.push_back(SizedCell(MedianOf(times.paper)));
    row.push_back(SizedCell(MedianOf(times.paper) / fast));
  }
  row.push_back(SizedCell(MedianOf(times.floor)));
  row.push_back(SizedCell(fast / MedianOf(times.floor)));
  row.push_back(SizedCell(fast / MedianOf(times.threads)));
  row.push_back(RealCell(times.fast_cost, 4));
  row.push_back(times.paper.empty() ? MissingCell()
                                    : RealCell(times.paper_cost, 4));
  return row;
}

}  // namespace

int RunSweepBenchmark(const std::vector<std::string>& arguments) {
  SweepOptions options;
  options.common.repeats = 3;
  OptionParser parser = MakeBenchmarkParser(
      "sweep", "times the first ten sweeps, per observation");
  AddBenchmarkOptions(&options.common, &parser);
  parser.AddInteger("num_threads", &options.num_threads, AtLeast(-1),
                    "Threads to compare with one; -1 or 0: all");
  parser.AddInteger("synthetic_size", &options.synthetic_size,
                    Between(0, kNumPaperSizes),
                    "A synthetic model of this row of the paper's Table 2 as "
                    "well; 0: none");
  parser.AddInteger("max_paper_observations", &options.max_paper_observations,
                    AtLeast(0), "Paper settings do not run on more");
  if (!ParseOrPrintHelp(arguments, options.common.log, &parser))
    return kExitDone;
  CheckReportPaths(options.common);
  const std::string threads =
      std::to_string(ResolveNumThreads(options.num_threads));
  ResultTable table;
  table.name = "sweep";
  table.caption =
      "Microseconds per observation and sweep over the first ten sweeps, one "
      "thread, paper settings in one round; the floor is one pass over all "
      "residuals";
  table.columns = {"model",          "observations",
                   "fast",           "paper",
                   "paper / fast",   "floor",
                   "fast / floor",   "gain of " + threads + " threads",
                   "fast ends (px)", "paper ends (px)"};
  const auto add = [&](const BenchmarkModel& model) {
    table.rows.push_back(Row(model, Measure(options, model)));
  };
  table.notes = MeasureModels(options.common, [&](const std::string& path) {
    add(ReadBenchmarkModel(path));
  });
  if (options.synthetic_size > 0) {
    add(SyntheticModel(kPaperSizes[options.synthetic_size - 1],
                       options.common.random_seed));
  }
  BenchmarkReport report;
  report.command = "sweep";
  report.tables = {std::move(table)};
  PublishReport(report, options.common);
  return kExitDone;
}

}  // namespace krot::internal
