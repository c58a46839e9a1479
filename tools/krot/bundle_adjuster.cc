#include <string>
#include <utility>
#include <vector>

#include "krot/base/parallel_for.h"
#include "krot/base/timer.h"
#include "krot/pipeline/adjust_model.h"
#include "krot/report/adjustment_report.h"
#include "krot/report/peak_memory.h"
#include "krot/report/text_table.h"
#include "krot/report/write_file.h"
#include "tools/krot/adjustment_options.h"
#include "tools/krot/command.h"
#include "tools/krot/common_options.h"
#include "tools/krot/html_path.h"
#include "tools/krot/interrupt.h"
#include "tools/krot/model_files.h"
#include "tools/krot/solve_progress.h"

namespace krot {
namespace {

std::string IterationLine(const BundleAdjustmentIteration& iteration) {
  std::string line = "iteration " + std::to_string(iteration.iteration) + ": ";
  if (iteration.is_successful) {
    line += "cost " + FormatNumber(iteration.cost, 3) + " px^2";
  } else {
    line += "step rejected";
  }
  if (iteration.barrier) {
    line += ", barrier " + Scientific(*iteration.barrier);
  }
  return line + ", trust region " + Scientific(iteration.radius) + ", " +
         FormatNumber(iteration.seconds, 2) + " s";
}

// The adjustment with its progress on stderr. Throws CommandError where there
// is nothing to write afterwards.
AdjustModelResult Adjust(const Model& model, AdjustModelOptions options,
                         const LogOptions& log) {
  options.adjustment.callback =
      [&log](const BundleAdjustmentIteration& iteration) {
        LogLine(log, 1, IterationLine(iteration));
      };
  SolveProgress progress(log, SolveProgress::GoalsOf(options.start));
  progress.Follow(&options.start);
  options.on_note = options.start.on_note;
  AdjustModelResult result = AdjustModel(model, options);
  progress.Finish();
  ThrowIfInterrupted();
  const AdjustModelSummary& summary = result.summary;
  switch (summary.adjustment.termination) {
    case BundleAdjustmentTermination::kNothingToAdjust:
      throw CommandError(kExitNothingToSolve,
                         NothingToAdjustSentence(summary.adjustment));
    case BundleAdjustmentTermination::kInfeasibleStart:
      throw CommandError(kExitNoStart, NoModelBelowCapSentence(summary));
    default:
      return result;
  }
}

int Run(const ModelPaths& paths, const CommonOptions& common,
        AdjustModelOptions options) {
  const Timer total_timer;
  const CancelFlag& cancel = CatchInterrupts();
  const WriteModelOptions write_options = CheckModelPaths(paths);
  AdjustmentReport report;
  report.version = KROT_VERSION;
  report.threads = ResolveNumThreads(options.adjustment.num_threads);
  report.seed = common.random_seed;

  const Timer read_timer;
  const Model model = ReadValidModel(paths.input_path);
  report.seconds_read = read_timer.Seconds();
  ThrowIfInterrupted();

  options.adjustment.cancel = &cancel;
  AdjustModelResult result = Adjust(model, std::move(options), common.log);
  report.summary = std::move(result.summary);

  LogLine(common.log, 2, "writing " + paths.output_path);
  const Timer write_timer;
  WriteModelTo(result.model, paths.output_path, write_options);
  report.seconds_write = write_timer.Seconds();
  report.seconds_total = total_timer.Seconds();
  report.peak_memory_bytes = PeakMemoryBytes();
  const std::string report_json = AdjustmentJson(report);
  if (!paths.report_path.empty()) {
    LogLine(common.log, 2, "writing " + paths.report_path);
    WriteFileAtomically(paths.report_path, report_json);
  }
  WriteHtmlPage(paths.html_path, report_json, model, result.model,
                report.threads, common.log);
  PrintTable(common.log, AdjustmentTable(report));
  return kExitDone;
}

}  // namespace

int RunBundleAdjuster(const std::vector<std::string>& arguments) {
  ModelPaths paths;
  AdjustmentOptions options;
  CommonOptions common;
  OptionParser parser("bundle_adjuster",
                      "lowers the sum of the squared reprojection errors of a "
                      "COLMAP model, below a cap if you want; the coordinate "
                      "frame stays");
  AddModelPaths(&paths, &parser);
  options.AddTo(&parser);
  AddCommonOptions(
      "Recorded in the report; this command draws no random numbers", &common,
      &parser);
  if (!parser.Parse(arguments)) {
    PrintTable(common.log, parser.Help());
    return kExitDone;
  }
  return Run(paths, common, options.Resolve(parser));
}

}  // namespace krot
