#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "krot/analysis/noise.h"
#include "krot/base/context.h"
#include "krot/base/write_file.h"
#include "krot/model/model_io.h"
#include "krot/options/command_options.h"
#include "krot/pipeline/adjust_model.h"
#include "krot/report/reports.h"
#include "krot/report/text_table.h"
#include "tools/krot/command.h"
#include "tools/krot/common_options.h"
#include "tools/krot/interrupt.h"
#include "tools/krot/metres.h"
#include "tools/krot/model_files.h"
#include "tools/krot/report_files.h"
#include "tools/krot/run_log.h"
#include "tools/krot/solve_progress.h"

namespace krot::internal {
namespace {

Progress ProgressOf(const BundleAdjustmentIteration& iteration) {
  std::string line = "iteration " + std::to_string(iteration.iteration) + ": ";
  if (iteration.is_successful) {
    line += "cost " + FormatNumber(iteration.cost, 3) + " px^2";
  } else {
    line += "step rejected";
  }
  if (iteration.cap) {
    line += ", cap " + FormatNumber(*iteration.cap, 4) + " px";
  } else {
    line += ", trust region " + Scientific(iteration.radius);
  }
  if (iteration.barrier) {
    line += ", barrier " + Scientific(*iteration.barrier);
  }
  line += ", " + FormatNumber(iteration.seconds, 2) + " s";
  return {"adjustment", line, std::nullopt};
}

// Adjusts, with progress on stderr. Throws CommandError if there is nothing to
// write afterwards.
AdjustModelResult Adjust(const Model& model, AdjustModelOptions options,
                         Context context, const LogOptions& log) {
  options.adjustment.callback =
      [&log](const BundleAdjustmentIteration& iteration) {
        ShowProgress(log, ProgressOf(iteration));
      };
  BeginPhase(log, "preparing the adjustment");
  SolveProgress progress(log, SolveProgress::GoalsOf(options.start));
  progress.Follow(&options.start, &context);
  AdjustModelResult result = AdjustModel(model, options, context);
  EndProgress();
  const AdjustModelSummary& summary = result.summary;
  switch (summary.adjustment.termination) {
    case BundleAdjustmentTermination::kNothingToAdjust:
      throw CommandError(kExitNothingToSolve,
                         NothingToAdjustSentence(summary.adjustment));
    case BundleAdjustmentTermination::kInfeasibleStart:
      throw CommandError(kExitNoStart, NoModelBelowCapSentence(summary));
    case BundleAdjustmentTermination::kInterrupted:
      if (summary.adjustment.num_iterations > 0) return result;
      throw CommandError(
          kExitInterrupted,
          "interrupted before the first iteration, nothing was written");
    default:
      return result;
  }
}

// Without metres where a length is only asked for; empty without a file.
std::vector<KnownDistance> ReadDistanceFile(const ModelPaths& paths,
                                            const Model& model,
                                            const LogOptions& log) {
  if (paths.distances_path.empty()) return {};
  LogInput(paths.distances_path);
  return ReadDistances(ReadFileBytes(paths.distances_path), model,
                       /*may_lack_metres=*/true, WarnOn(log));
}

// The surveyed points of the model; empty without a file. Throws ModelError if
// there are too few to compare with: without known positions, a similarity is
// fitted to them.
std::vector<KnownPosition> ReadCheckPoints(const std::string& path,
                                           const Model& model,
                                           bool has_positions,
                                           const LogOptions& log) {
  if (path.empty()) return {};
  LogInput(path);
  // The radius of the check points is not used.
  std::vector<KnownPosition> points =
      ReadPointPositions(ReadFileBytes(path), model, {1.0, WarnOn(log)});
  if (!has_positions && !CompareWithSurvey(model, points)) {
    throw ModelError(path + ": found " + std::to_string(points.size()) +
                     " check points of the model, expected three or more that "
                     "are not on a line");
  }
  return points;
}

int Run(const ModelPaths& paths, const std::string& check_points_path,
        const CommonOptions& common, AdjustModelOptions options,
        int num_threads) {
  const Timer total_timer;
  const WriteModelOptions write_options = CheckModelPaths(paths, common.log);
  AdjustmentReport report;
  report.run.seed = common.random_seed;

  Model model = ReadInput(paths, common.log, &report.run);
  WarnOfConventions(paths, model, common.log);
  options.adjustment.fixed = ReadFixedParts(paths, model, common.log);
  const Survey survey(ReadKnownPositions(paths, model, common.log),
                      paths.output_frame == "own", &model);
  options.adjustment.positions = survey.positions();
  const DistanceSurvey distances(
      ReadDistanceFile(paths, model, common.log),
      options.adjustment.fixed.Any() ? 1 : survey.scale(), &model);
  options.adjustment.distances = distances.distances();

  const std::vector<KnownPosition> check_points = ReadCheckPoints(
      check_points_path, model, !survey.positions().empty(), common.log);
  options.finds_precision =
      !paths.report_path.empty() || !paths.html_path.empty();
  Context context{num_threads};
  if (paths.write_on_interrupt) context.cancel = &DeferInterrupts();
  AdjustModelResult result =
      Adjust(model, std::move(options), context, common.log);
  DeferInterrupts();
  report.summary = std::move(result.summary);
  report.positions = survey.ComparePositions(result.model);
  report.check_points = survey.CompareCheckPoints(result.model, check_points);
  report.position_frame = survey.frame();
  report.is_in_position_frame = survey.is_in_own_frame();
  report.faults = FindLastingFaults(result.model);
  report.distances = distances.Compare(result.model, report.summary);

  WriteOutput(result.model, paths, write_options, common.log, &report.run);
  RecordEnd(total_timer, num_threads, &report.run);
  const bool is_text =
      std::filesystem::path(paths.report_path).extension() == ".txt";
  if (is_text) {
    BeginPhase(common.log, "writing " + paths.report_path);
    WriteFileAtomically(paths.report_path,
                        AdjustmentText(report, result.model));
  }
  WriteReports(is_text ? "" : paths.report_path, paths.html_path,
               AdjustmentJson(report, result.model), model, result.model,
               num_threads, common.log);
  PrintTable(common.log, AdjustmentTable(report));
  for (const std::string& words : AdjustmentWarnings(report, result.model)) {
    LogLine(common.log, 0, "warning: " + words);
  }
  WarnOfDegeneration(model, result.model, common.log);
  if (context.IsCancelled()) ThrowInterrupted(paths);
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
  AddModelPaths(&paths, &parser, nullptr,
                "Where the report goes: as text if its name ends in .txt, else "
                "as JSON");
  AddFixedPaths(&paths, &parser);
  AddPositionsPath(&paths, &parser);
  AddDistancesPath(&paths.distances_path, &parser);
  std::string check_points_path;
  parser.AddPath("check_points_path", &check_points_path, false, "a file",
                 "Surveyed 3D points, lines of ID X Y Z, that have no say: the "
                 "report compares them, in the survey's frame and unit");
  AddWriteOnInterrupt(&paths, &parser);
  options.AddTo(&parser);
  AddCommonOptions(&common, &parser);
  if (!ParseOrPrintHelp(arguments, common.log, &parser)) return kExitDone;
  CheckPositionsPath(paths, parser);
  if (parser.IsGiven("BundleAdjustment.max_error") ||
      parser.IsGiven("BundleAdjustment.max_error_factor")) {
    parser.Refuse("positions_path", "with a cap");
    parser.Refuse("point_positions_path", "with a cap");
    parser.Refuse("distances_path", "with a cap");
  }
  return Run(paths, check_points_path, common, options.Resolve(parser),
             options.num_threads());
}

}  // namespace krot::internal
