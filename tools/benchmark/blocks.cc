// krot_benchmark blocks: compares `fast` with `paper` settings on single
// sub-problems of a sweep over real models, both points and frames, from a cold
// start. With `fast` settings points are solved side by side, as in sweeps.

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "tools/benchmark/benchmark_command.h"
#include "tools/benchmark/benchmark_model.h"
#include "tools/benchmark/benchmark_report.h"
#include "tools/benchmark/competition.h"
#include "tools/benchmark/model_list.h"
#include "tools/benchmark/timing.h"
#include "tools/krot/command_error.h"

namespace krot::internal {
namespace {

struct BlocksOptions {
  BenchmarkOptions common;
  int max_points = 1000;
  int max_frames = 30;
};

// The times of both settings for blocks of one kind, and the largest excess of
// the cost of `fast` over that of `paper`, relative.
struct Duel {
  int64_t num_blocks = 0;
  double fast = 0;   // seconds per block
  double paper = 0;  // likewise
  double excess = 0;
};

// At most `max_count` of `count` blocks, evenly spread. `residuals(k)` returns
// the residuals of block k. Blocks that MakeBlock rejects are left out.
template <typename Residuals>
std::vector<Subproblem> Blocks(int32_t count, int32_t max_count,
                               const std::vector<Eigen::Vector3d>& starts,
                               const Residuals& residuals) {
  std::vector<Subproblem> blocks;
  const int32_t step = std::max(1, (count + max_count - 1) / max_count);
  for (int32_t k = 0; k < count; k += step) {
    std::optional<Subproblem> block = MakeBlock(residuals(k), starts[k]);
    if (block) blocks.push_back(std::move(*block));
  }
  return blocks;
}

// Measures both settings; the solvers are `fast` and `paper`, in this order.
Duel Fight(const std::vector<Subproblem>& blocks,
           const std::vector<std::unique_ptr<SubproblemSolver>>& solvers,
           int repeats) {
  Duel duel;
  duel.num_blocks = static_cast<int64_t>(blocks.size());
  if (blocks.empty()) return duel;
  const std::vector<Standing> standings =
      Compete(blocks, Norm::L2(), solvers, repeats);
  duel.fast = standings[0].seconds;
  duel.paper = standings[1].seconds;
  duel.excess = standings[0].max_excess;
  return duel;
}

void AddDuel(const Duel& duel, std::vector<Cell>* row) {
  row->push_back(CountCell(duel.num_blocks));
  row->push_back(SizedCell(1e6 * duel.fast));
  row->push_back(SizedCell(1e6 * duel.paper));
  row->push_back(SizedCell(duel.paper / duel.fast));
}

std::vector<Cell> Row(const BlocksOptions& options,
                      const BenchmarkModel& model) {
  const KnownRotationProblem& problem = model.built.problem;
  const Estimate& start = model.built.start;
  const Duel points = Fight(
      Blocks(
          problem.num_points, options.max_points, start.points,
          [&](int32_t k) { return IntersectionResiduals(problem, start, k); }),
      SideBySideAndPaper(Norm::L2()), options.common.repeats);
  const Duel frames = Fight(
      Blocks(problem.num_frames, options.max_frames, start.translations,
             [&](int32_t f) { return ResectionResiduals(problem, start, f); }),
      FastAndPaper(Norm::L2()), options.common.repeats);
  std::vector<Cell> row = {TextCell(model.name)};
  AddDuel(points, &row);
  AddDuel(frames, &row);
  const auto of_all = [&](double per_point, double per_frame) {
    return problem.num_points * per_point + problem.num_frames * per_frame;
  };
  row.push_back(SizedCell(of_all(points.paper, frames.paper) /
                          of_all(points.fast, frames.fast)));
  row.push_back(ScientificCell(std::max(points.excess, frames.excess)));
  return row;
}

}  // namespace

int RunBlocksBenchmark(const std::vector<std::string>& arguments) {
  BlocksOptions options;
  options.common.repeats = 3;
  OptionParser parser = MakeBenchmarkParser(
      "blocks", "times single sub-problems of models, points and frames");
  AddBenchmarkOptions(&options.common, &parser);
  parser.AddInteger("max_points", &options.max_points, AtLeast(1),
                    "Points to measure per model, evenly spread");
  parser.AddInteger("max_frames", &options.max_frames, AtLeast(1),
                    "Frames to measure per model, evenly spread");
  if (!ParseOrPrintHelp(arguments, options.common.log, &parser))
    return kExitDone;
  if (options.common.input_paths.empty()) {
    throw OptionError("--input_path is required");
  }
  CheckReportPaths(options.common);
  ResultTable table;
  table.name = "blocks";
  table.caption =
      "Microseconds of processor time per sub-problem, p = 2, cold from the "
      "model's own estimate: points (Int), `fast` ones side by side, frames "
      "(Res), and the ratio of all "
      "points and frames together, as in a first sweep";
  table.columns = {"model",     "points", "Int fast",        "Int paper",
                   "Int ratio", "frames", "Res fast",        "Res paper",
                   "Res ratio", "ratio",  "fast above paper"};
  table.notes = MeasureModels(options.common, [&](const std::string& path) {
    table.rows.push_back(Row(options, ReadBenchmarkModel(path)));
  });
  BenchmarkReport report;
  report.command = "blocks";
  report.tables = {std::move(table)};
  PublishReport(report, options.common);
  return kExitDone;
}

}  // namespace krot::internal
