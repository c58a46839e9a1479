// krot_benchmark known_rotation: Table 2 of [Zhang18] on models and on
// synthetic ones of its sizes.

#include <algorithm>
#include <iterator>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "krot/base/parallel_for.h"
#include "krot/base/timer.h"
#include "krot/problem/cost.h"
#include "tools/benchmark/benchmark_command.h"
#include "tools/benchmark/benchmark_report.h"
#include "tools/benchmark/known_rotation_solver.h"
#include "tools/benchmark/synthetic_model.h"
#include "tools/benchmark/timing.h"
#include "tools/command_error.h"

namespace krot {
namespace {

struct KnownRotationOptions {
  BenchmarkOptions common;
  int num_threads = -1;
  int synthetic_sizes = kNumPaperSizes;
  int max_rival_observations = 50000;
  double time_limit = 60;  // seconds
};

struct Outcome {
  std::vector<double> seconds;
  double cost = 0;  // pixels
  bool has_finished = true;
};

// The runs of one solver end early once they have taken this long together.
constexpr double kEnoughSeconds = 20;

void Run(const BenchmarkModel& model, double time_limit,
         KnownRotationSolver* solver, Outcome* outcome) {
  double sum = 0;
  for (const double seconds : outcome->seconds) sum += seconds;
  if (sum > kEnoughSeconds || !outcome->has_finished) return;
  Estimate estimate = model.built.start;
  const Timer timer;
  outcome->has_finished =
      solver->Minimize(model.built.problem, time_limit, &estimate);
  outcome->seconds.push_back(timer.Seconds());
  outcome->cost = Cost(model.built.problem, estimate, Norm::L2(), -1);
}

using Solvers = std::vector<std::unique_ptr<KnownRotationSolver>>;

std::string Title(const KnownRotationSolver& solver) {
  return solver.Name() + " x" + std::to_string(solver.NumThreads());
}

class Contest {
 public:
  explicit Contest(const KnownRotationOptions& options) : options_(options) {
    solvers_ = OwnFullSolvers(ResolveNumThreads(options.num_threads));
    num_own_ = solvers_.size();
    Solvers rivals = RivalFullSolvers(ResolveNumThreads(options.num_threads));
    std::move(rivals.begin(), rivals.end(), std::back_inserter(solvers_));
    seconds_.name = "table2";
    seconds_.caption = "Seconds on the whole problem, p = 2, on x threads";
    costs_.name = "table2_cost";
    costs_.caption =
        "Pixels: the largest residual that they start from and end at";
    seconds_.columns = {"model", "images", "points", "observations"};
    costs_.columns = {"model", "start"};
    for (const auto& solver : solvers_) {
      seconds_.columns.push_back(Title(*solver));
      costs_.columns.push_back(Title(*solver));
    }
    seconds_.notes = {
        "* ends more than 1e-3 above the lowest cost, relative (next table): "
        "its time is not that of the optimum. n/a: not finished within the "
        "time limit, or not run on so many observations."};
  }

  void Add(const BenchmarkModel& model) {
    const KnownRotationProblem& problem = model.built.problem;
    const int64_t count = static_cast<int64_t>(problem.observations.size());
    std::vector<Outcome> outcomes(solvers_.size());
    for (int repeat = 0; repeat < options_.common.repeats; ++repeat) {
      for (size_t s = 0; s < solvers_.size(); ++s) {
        const bool is_rival = s >= num_own_ && s + 1 < solvers_.size();
        if (is_rival && count > options_.max_rival_observations) continue;
        LogLine(options_.common.log, 1,
                model.name + ": " + Title(*solvers_[s]));
        Run(model, options_.time_limit, solvers_[s].get(), &outcomes[s]);
      }
    }
    double lowest = std::numeric_limits<double>::infinity();
    for (const Outcome& outcome : outcomes) {
      if (!outcome.seconds.empty()) lowest = std::min(lowest, outcome.cost);
    }
    std::vector<Cell> seconds = {
        TextCell(model.name), CountCell(problem.num_frames),
        CountCell(problem.num_points), CountCell(count)};
    std::vector<Cell> costs = {
        TextCell(model.name),
        RealCell(Cost(problem, model.built.start, Norm::L2(), -1), 4)};
    for (const Outcome& outcome : outcomes) {
      if (outcome.seconds.empty()) {
        seconds.push_back(MissingCell());
        costs.push_back(MissingCell());
        continue;
      }
      Cell cell = outcome.has_finished ? SizedCell(Median(outcome.seconds))
                                       : MissingCell();
      const bool misses = outcome.cost > (1 + kSameCost) * lowest;
      if (outcome.has_finished && misses) cell.text += " *";
      seconds.push_back(std::move(cell));
      costs.push_back(RealCell(outcome.cost, 4));
    }
    seconds_.rows.push_back(std::move(seconds));
    costs_.rows.push_back(std::move(costs));
  }

  std::vector<ResultTable> TakeTables() {
    return {std::move(seconds_), std::move(costs_)};
  }

 private:
  static constexpr double kSameCost = 1e-3;

  const KnownRotationOptions& options_;
  Solvers solvers_;  // the last is least squares
  size_t num_own_ = 0;
  ResultTable seconds_;
  ResultTable costs_;
};

}  // namespace

int RunKnownRotationBenchmark(const std::vector<std::string>& arguments) {
  KnownRotationOptions options;
  options.common.repeats = 3;
  OptionParser parser = MakeBenchmarkParser(
      "known_rotation", "times the whole problem, translations and points");
  AddBenchmarkOptions(&options.common, &parser);
  parser.AddInteger("num_threads", &options.num_threads, AtLeast(-1),
                    "Threads; -1 or 0: all");
  parser.AddInteger("synthetic_sizes", &options.synthetic_sizes,
                    Between(0, kNumPaperSizes),
                    "Synthetic models of the first so many sizes of the "
                    "paper's Table 2");
  parser.AddInteger("max_rival_observations", &options.max_rival_observations,
                    AtLeast(0),
                    "Gugat and proximal splitting do not run on more");
  parser.AddReal("time_limit", &options.time_limit, Above(0.0, "seconds"),
                 "After which a rival is given up");
  if (!parser.Parse(arguments)) {
    PrintTable(options.common.log, parser.Help());
    return kExitDone;
  }
  CheckReportPaths(options.common);
  Contest contest(options);
  for (const std::string& path : options.common.input_paths) {
    contest.Add(ReadBenchmarkModel(path));
  }
  for (int size = 0; size < options.synthetic_sizes; ++size) {
    contest.Add(SyntheticModel(kPaperSizes[size], options.common.random_seed));
  }
  BenchmarkReport report;
  report.command = "known_rotation";
  report.tables = contest.TakeTables();
  PublishReport(report, options.common);
  return kExitDone;
}

}  // namespace krot
