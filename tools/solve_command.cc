#include "tools/solve_command.h"

#include <utility>
#include <vector>

#include "krot/base/parallel_for.h"
#include "krot/base/timer.h"
#include "krot/report/peak_memory.h"
#include "krot/report/solve_report.h"
#include "krot/report/text_table.h"
#include "krot/report/write_file.h"
#include "tools/interrupt.h"
#include "tools/sweep_progress.h"

namespace krot {
namespace {

SolveReport DescribeRun(const SolveCommand& command) {
  SolveReport report;
  report.version = KROT_VERSION;
  report.command = command.name;
  report.method = command.method;
  report.threads = ResolveNumThreads(command.options.res_int.num_threads);
  report.seed = command.common.random_seed;
  return report;
}

// The solve with its progress on stderr. Throws CommandError where there is
// nothing to write afterwards.
SolveModelResult Solve(const SolveCommand& command, const Model& model,
                       const CancelFlag& cancel) {
  const LogOptions& log = command.common.log;
  SolveModelOptions options = command.options;
  SweepProgress progress(log, options.res_int.sweep_tolerance,
                         options.res_int.max_sweeps);
  options.res_int.cancel = &cancel;
  options.res_int.callback = [&progress](int sweep, const Sweep& state) {
    progress.Update(sweep, state);
  };
  options.on_built = [&](const SolveSummary& summary) {
    ThrowIfInterrupted();
    if (summary.num_observations == 0) {
      throw CommandError(kExitNothingToSolve, NothingToSolveSentence(summary));
    }
    LogLine(log, 1,
            Counted(summary.num_images, "image") + ", " +
                Counted(summary.num_points, "point") + ", " +
                Counted(summary.num_observations, "observation") +
                "; the solve needs about " +
                FormatBytes(EstimateSolveBytes(model)));
  };
  SolveModelResult result = command.solve(model, options);
  progress.Finish();
  ThrowIfInterrupted();
  return result;
}

void WarnOfWhiteSpace(const LogOptions& log, const Model& model) {
  const std::vector<std::string> names = ImageNamesWithWhiteSpace(model);
  if (names.empty()) return;
  LogLine(
      log, 1,
      "warning: " + Counted(static_cast<int64_t>(names.size()), "image name") +
          " with white space, at which COLMAP ends a name when it reads "
          "text: '" +
          names.front() + "' for one; --output_type BIN avoids that");
}

}  // namespace

int RunSolveCommand(const SolveCommand& command) {
  const Timer total_timer;
  const LogOptions& log = command.common.log;
  const ModelPaths& paths = command.paths;
  const CancelFlag& cancel = CatchInterrupts();
  const WriteModelOptions write_options = CheckModelPaths(paths);
  SolveReport report = DescribeRun(command);

  const Timer read_timer;
  const Model model = ReadValidModel(paths.input_path);
  report.seconds_read = read_timer.Seconds();
  ThrowIfInterrupted();

  SolveModelResult result = Solve(command, model, cancel);
  report.summary = std::move(result.summary);

  if (write_options.format == ModelFormat::kText) {
    WarnOfWhiteSpace(log, result.model);
  }
  LogLine(log, 2, "writing " + paths.output_path);
  const Timer write_timer;
  WriteModelTo(result.model, paths.output_path, write_options);
  report.seconds_write = write_timer.Seconds();
  report.seconds_total = total_timer.Seconds();
  report.peak_memory_bytes = PeakMemoryBytes();
  if (!paths.report_path.empty()) {
    LogLine(log, 2, "writing " + paths.report_path);
    WriteFileAtomically(paths.report_path, SolveJson(report));
  }
  PrintTable(log, SolveTable(report));
  return kExitDone;
}

}  // namespace krot
