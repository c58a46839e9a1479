// krot_benchmark known_rotation: Table 2 of [Zhang18], on given models and on
// synthetic ones of the same sizes.

#include <algorithm>
#include <iterator>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/parallel_for.h"
#include "krot/problem/cost.h"
#include "tools/benchmark/benchmark_command.h"
#include "tools/benchmark/benchmark_report.h"
#include "tools/benchmark/known_rotation_solver.h"
#include "tools/benchmark/model_list.h"
#include "tools/benchmark/synthetic_model.h"
#include "tools/benchmark/time_limit.h"
#include "tools/benchmark/timing.h"
#include "tools/krot/command_error.h"

namespace krot::internal {
namespace {

struct KnownRotationOptions {
  BenchmarkOptions common;
  int num_threads = -1;
  int synthetic_sizes = kNumPaperSizes;
  double time_limit = 20;  // seconds
};

struct Outcome {
  std::vector<double> seconds;
  double cost = 0;  // pixels
  bool has_finished = true;
};

using Solvers = std::vector<std::unique_ptr<KnownRotationSolver>>;

// A solver is not run again once its runs have taken this long in total.
constexpr double kEnoughSeconds = 20;

void Run(const BenchmarkModel& model, const CancelFlag* cancel,
         KnownRotationSolver* solver, Outcome* outcome) {
  const std::vector<double>& past = outcome->seconds;
  const double sum = std::accumulate(past.begin(), past.end(), 0.0);
  if (sum > kEnoughSeconds || !outcome->has_finished) return;
  Estimate estimate = model.built.start;
  const Timer timer;
  outcome->has_finished =
      solver->Minimize(model.built.problem, cancel, &estimate);
  outcome->seconds.push_back(timer.Seconds());
  outcome->cost = Cost(model.built.problem, estimate, Norm::L2(), -1);
}

std::string Title(const KnownRotationSolver& solver) {
  return solver.Name() + " x" + std::to_string(solver.NumThreads());
}

Solvers Joined(Solvers a, Solvers b) {
  std::move(b.begin(), b.end(), std::back_inserter(a));
  return a;
}

class Contest {
 public:
  explicit Contest(const KnownRotationOptions& options) : options_(options) {
    const int num_threads = ResolveNumThreads(options.num_threads);
    solvers_ = OwnFullSolvers(num_threads);
    num_unlimited_ = solvers_.size();
    solvers_ = Joined(std::move(solvers_), PaperFullSolvers(num_threads));
    solvers_ = Joined(std::move(solvers_), RivalFullSolvers(num_threads));
    seconds_.name = "table2";
    seconds_.caption = "Seconds on the whole problem, p = 2, on x threads";
    costs_.name = "table2_cost";
    costs_.caption =
        "Pixels: the largest residual that they start from and end at";
    seconds_.columns = {"model", "images", "points", "observations"};
    costs_.columns = {"model", "start"};
    plot_.title = "Synthetic models of the sizes of the paper's Table 2";
    plot_.x_label = "observations";
    plot_.y_label = "seconds, where finished";
    for (const auto& solver : solvers_) {
      seconds_.columns.push_back(Title(*solver));
      costs_.columns.push_back(Title(*solver));
      plot_.series.push_back({Title(*solver), {}});
    }
    seconds_.notes = {
        "* ends more than 1e-3 above the lowest cost, relative (next table): "
        "its time is not that of the optimum. " +
        LimitText() +
        ": given up at this limit; the next table says how far it came. KROT's "
        "own have no limit."};
  }

  void Add(const BenchmarkModel& model) {
    const std::vector<Outcome> outcomes = Compete(model);
    double lowest = std::numeric_limits<double>::infinity();
    for (const Outcome& outcome : outcomes) {
      lowest = std::min(lowest, outcome.cost);
    }
    const KnownRotationProblem& problem = model.built.problem;
    std::vector<Cell> seconds = {
        TextCell(model.name), CountCell(model.num_images),
        CountCell(problem.num_points), CountCell(NumObservations(model))};
    std::vector<Cell> costs = {
        TextCell(model.name),
        RealCell(Cost(problem, model.built.start, Norm::L2(), -1), 4)};
    for (const Outcome& outcome : outcomes) {
      seconds.push_back(TimeCell(outcome, lowest));
      costs.push_back(RealCell(outcome.cost, 4));
    }
    seconds_.rows.push_back(std::move(seconds));
    costs_.rows.push_back(std::move(costs));
  }

  void AddSynthetic(const ModelSize& size) {
    const BenchmarkModel model =
        SyntheticModel(size, options_.common.random_seed);
    Add(model);
    PlotLastRow();
  }

  // May be called only once; `notes` are put below the times.
  BenchmarkReport TakeReport(const std::vector<std::string>& notes) {
    BenchmarkReport report;
    report.command = "known_rotation";
    seconds_.notes.insert(seconds_.notes.end(), notes.begin(), notes.end());
    report.tables = {std::move(seconds_), std::move(costs_)};
    if (options_.synthetic_sizes > 0) {
      for (PlotSeries& series : plot_.series) {
        std::sort(series.points.begin(), series.points.end());
      }
      report.plot = std::move(plot_);
    }
    return report;
  }

 private:
  static constexpr double kSameCost = 1e-3;

  static int64_t NumObservations(const BenchmarkModel& model) {
    return static_cast<int64_t>(model.built.problem.observations.size());
  }

  std::string LimitText() const {
    return "> " + NumberText(options_.time_limit);
  }

  std::vector<Outcome> Compete(const BenchmarkModel& model) const {
    std::vector<Outcome> outcomes(solvers_.size());
    for (int repeat = 0; repeat < options_.common.repeats; ++repeat) {
      for (size_t s = 0; s < solvers_.size(); ++s) {
        LogLine(options_.common.log, 1,
                model.name + ": " + Title(*solvers_[s]));
        const TimeLimit limit(options_.time_limit);
        Run(model, s < num_unlimited_ ? nullptr : limit.flag(),
            solvers_[s].get(), &outcomes[s]);
      }
    }
    return outcomes;
  }

  // Adds the last row to the plot, for solvers that have finished; for each
  // method only the variant with the most threads.
  void PlotLastRow() {
    const std::vector<Cell>& row = seconds_.rows.back();
    const size_t first = row.size() - solvers_.size();
    const double count = row[first - 1].value;  // of observations
    for (size_t s = 0; s < solvers_.size(); ++s) {
      const bool has_more_threads =
          s + 1 < solvers_.size() &&
          solvers_[s]->Name() == solvers_[s + 1]->Name();
      const Cell& cell = row[first + s];
      if (has_more_threads || !cell.value.is_number()) continue;
      plot_.series[s].points.emplace_back(count, cell.value.get<double>());
    }
  }

  Cell TimeCell(const Outcome& outcome, double lowest) const {
    if (!outcome.has_finished) return MissingCell(LimitText());
    Cell cell = SizedCell(MedianOf(outcome.seconds));
    if (outcome.cost > (1 + kSameCost) * lowest) cell.text += " *";
    return cell;
  }

  const KnownRotationOptions options_;
  Solvers solvers_;
  size_t num_unlimited_ = 0;  // number of first solvers without a time limit
  ResultTable seconds_;
  ResultTable costs_;
  LogPlot plot_;  // of the synthetic models
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
  parser.AddReal("time_limit", &options.time_limit, Above(0.0, "seconds"),
                 "After which a rival or the paper's method is given up");
  if (!ParseOrPrintHelp(arguments, options.common.log, &parser))
    return kExitDone;
  CheckReportPaths(options.common);
  Contest contest(options);
  const std::vector<std::string> left_out = MeasureModels(
      options.common,
      [&](const std::string& path) { contest.Add(ReadBenchmarkModel(path)); });
  for (int size = 0; size < options.synthetic_sizes; ++size) {
    contest.AddSynthetic(kPaperSizes[size]);
  }
  PublishReport(contest.TakeReport(left_out), options.common);
  return kExitDone;
}

}  // namespace krot::internal
