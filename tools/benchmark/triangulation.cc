// krot_benchmark triangulation: Figure 4 and Table 1 of [Zhang18], with all
// rivals on the same instances in the same run.

#include <string>
#include <vector>

#include "tools/benchmark/benchmark_command.h"
#include "tools/benchmark/benchmark_model.h"
#include "tools/benchmark/benchmark_report.h"
#include "tools/benchmark/competition.h"
#include "tools/benchmark/model_list.h"
#include "tools/krot/command_error.h"

namespace krot::internal {
namespace {

constexpr double kSigma = 5;           // pixels, as in Fig. 4
constexpr int kInstancesPerSize = 20;  // likewise
constexpr int kSizes[] = {2, 3, 5, 10, 20, 50, 100, 200};

struct TriangulationOptions {
  BenchmarkOptions common;
  std::string norm = "2";
  int max_points = 1000;
  bool figure4 = true;
};

struct Case {
  std::string name;
  int64_t num_points = 0;
  int64_t num_images = 0;
  std::vector<Subproblem> instances;
};

double MeanSize(const Case& one) {
  double sum = 0;
  for (const Subproblem& problem : one.instances) {
    sum += static_cast<double>(problem.residuals.size());
  }
  return sum / static_cast<double>(one.instances.size());
}

Case SyntheticCase(int num_cameras, Random* random) {
  Case result;
  result.name = std::to_string(num_cameras);
  while (result.instances.size() < kInstancesPerSize) {
    std::optional<Subproblem> problem = MakeTriangulation(
        RandomTriangulation(num_cameras, kSigma, random), random);
    if (problem) result.instances.push_back(std::move(*problem));
  }
  return result;
}

// At most `max_points` of the model's points, evenly spread over the file.
// Points are left out if no two of their rays, at half a degree or more, meet
// in front of all cameras.
Case ModelCase(const std::string& path, int max_points, Random* random) {
  const BenchmarkModel model = ReadBenchmarkModel(path);
  const BuiltProblem& built = model.built;
  Case result;
  result.name = model.name;
  result.num_points = built.problem.num_points;
  result.num_images = model.num_images;
  const int step = (built.problem.num_points + max_points - 1) / max_points;
  for (int32_t k = 0; k < built.problem.num_points; k += step) {
    std::optional<Subproblem> problem = MakeTriangulation(
        IntersectionResiduals(built.problem, built.start, k), random);
    if (problem) result.instances.push_back(std::move(*problem));
  }
  if (result.instances.empty()) {
    throw CommandError(kExitNothingToSolve,
                       path + " has no point that two rays determine");
  }
  return result;
}

// Microseconds per instance; solvers that miss the optimum are marked.
std::vector<Cell> StandingCells(const std::vector<Standing>& standings) {
  std::vector<Cell> cells;
  for (const Standing& standing : standings) {
    Cell cell = SizedCell(1e6 * standing.seconds);
    if (standing.max_excess > kSameOptimum) cell.text += " *";
    cells.push_back(std::move(cell));
  }
  return cells;
}

void AddExcessRow(const std::vector<Standing>& standings,
                  const std::string& name, ResultTable* table) {
  std::vector<Cell> row = {TextCell(name)};
  for (const Standing& standing : standings) {
    row.push_back(ScientificCell(standing.max_excess));
  }
  table->rows.push_back(std::move(row));
}

ResultTable ExcessTable(const std::string& name,
                        const std::vector<std::string>& solvers,
                        const std::string& first_column) {
  ResultTable table;
  table.name = name + "_excess";
  table.caption =
      "How far the solvers end above the lowest cost of any of them, relative, "
      "at most";
  table.is_detail = true;
  table.columns = {first_column};
  table.columns.insert(table.columns.end(), solvers.begin(), solvers.end());
  return table;
}

const char kMissNote[] =
    "* ends more than 1e-5 above the lowest cost, relative, on some instance "
    "(last table): its time is not that of the optimum.";

// The times divided by that of the first solver; missing for solvers that miss
// the optimum.
void AddRatioRow(const std::vector<Standing>& standings,
                 const std::string& name, ResultTable* table) {
  std::vector<Cell> row = {TextCell(name)};
  for (const Standing& standing : standings) {
    row.push_back(standing.max_excess > kSameOptimum
                      ? MissingCell()
                      : SizedCell(standing.seconds / standings[0].seconds));
  }
  table->rows.push_back(std::move(row));
}

ResultTable RatioTable(const std::string& name,
                       const std::vector<std::string>& solvers,
                       const std::string& first_column) {
  ResultTable table;
  table.name = name + "_ratio";
  table.is_detail = true;
  table.caption = "The same times by that of " + solvers.front() +
                  ", where the optimum is reached on every instance";
  table.columns = {first_column};
  table.columns.insert(table.columns.end(), solvers.begin(), solvers.end());
  return table;
}

std::vector<std::string> Names(
    const std::vector<std::unique_ptr<SubproblemSolver>>& solvers) {
  std::vector<std::string> names;
  for (const auto& solver : solvers) names.push_back(solver->Name());
  return names;
}

void RunFigure4(const TriangulationOptions& options, Norm norm,
                BenchmarkReport* report) {
  const auto solvers = AllSolvers(norm);
  const std::vector<std::string> names = Names(solvers);
  ResultTable table;
  table.name = "figure4";
  table.caption =
      "Microseconds of processor time per triangulation, random cameras, sigma "
      "= 5 px, p = " +
      options.norm;
  table.columns = {"cameras"};
  table.columns.insert(table.columns.end(), names.begin(), names.end());
  table.notes = {kMissNote};
  ResultTable ratios = RatioTable(table.name, names, "cameras");
  ResultTable excess = ExcessTable(table.name, names, "cameras");
  LogPlot plot;
  plot.title = "Triangulation, p = " + options.norm;
  plot.x_label = "cameras";
  plot.y_label = "microseconds per point";
  for (const std::string& name : names) plot.series.push_back({name, {}});
  Random random(options.common.random_seed);
  for (const int size : kSizes) {
    LogLine(options.common.log, 1, std::to_string(size) + " cameras");
    const Case one = SyntheticCase(size, &random);
    const std::vector<Standing> standings =
        Compete(one.instances, norm, solvers, options.common.repeats);
    std::vector<Cell> row = {CountCell(size)};
    for (Cell& cell : StandingCells(standings)) row.push_back(std::move(cell));
    table.rows.push_back(std::move(row));
    AddRatioRow(standings, one.name, &ratios);
    AddExcessRow(standings, one.name, &excess);
    for (size_t s = 0; s < standings.size(); ++s) {
      plot.series[s].points.emplace_back(size, 1e6 * standings[s].seconds);
    }
  }
  report->tables.push_back(std::move(table));
  report->tables.push_back(std::move(ratios));
  report->tables.push_back(std::move(excess));
  report->plot = std::move(plot);
}

void RunTable1(const TriangulationOptions& options, Norm norm,
               BenchmarkReport* report) {
  const auto solvers = AllSolvers(norm);
  const std::vector<std::string> names = Names(solvers);
  ResultTable table;
  table.name = "table1";
  table.caption =
      "Microseconds of processor time per triangulation of a model's points, p "
      "= " +
      options.norm;
  table.columns = {"model", "points", "images", "measured", "mean L"};
  table.columns.insert(table.columns.end(), names.begin(), names.end());
  table.notes = {kMissNote};
  ResultTable ratios = RatioTable(table.name, names, "model");
  ResultTable excess = ExcessTable(table.name, names, "model");
  const auto measure = [&](const std::string& path) {
    Random random(options.common.random_seed);
    const Case one = ModelCase(path, options.max_points, &random);
    const std::vector<Standing> standings =
        Compete(one.instances, norm, solvers, options.common.repeats);
    std::vector<Cell> row = {
        TextCell(one.name), CountCell(one.num_points),
        CountCell(one.num_images),
        CountCell(static_cast<int64_t>(one.instances.size())),
        RealCell(MeanSize(one), 2)};
    for (Cell& cell : StandingCells(standings)) row.push_back(std::move(cell));
    table.rows.push_back(std::move(row));
    AddRatioRow(standings, one.name, &ratios);
    AddExcessRow(standings, one.name, &excess);
  };
  const std::vector<std::string> left_out =
      MeasureModels(options.common, measure);
  table.notes.insert(table.notes.end(), left_out.begin(), left_out.end());
  report->tables.push_back(std::move(table));
  report->tables.push_back(std::move(ratios));
  report->tables.push_back(std::move(excess));
}

}  // namespace

int RunTriangulationBenchmark(const std::vector<std::string>& arguments) {
  TriangulationOptions options;
  OptionParser parser = MakeBenchmarkParser(
      "triangulation", "times the triangulation of one point at a time");
  AddBenchmarkOptions(&options.common, &parser);
  parser.AddChoice("norm", &options.norm, {"2", "inf"}, "The p of the cost");
  parser.AddInteger("max_points", &options.max_points, AtLeast(1),
                    "Points to measure per model, evenly spread");
  parser.AddBool("figure4", &options.figure4,
                 "Measure random cameras as well (Figure 4 of the paper)");
  if (!ParseOrPrintHelp(arguments, options.common.log, &parser))
    return kExitDone;
  CheckReportPaths(options.common);
  const Norm norm = options.norm == "2" ? Norm::L2() : Norm::LInf();
  BenchmarkReport report;
  report.command = "triangulation";
  if (options.figure4) RunFigure4(options, norm, &report);
  if (!options.common.input_paths.empty()) RunTable1(options, norm, &report);
  PublishReport(report, options.common);
  return kExitDone;
}

}  // namespace krot::internal
