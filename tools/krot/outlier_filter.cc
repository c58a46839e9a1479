#include <string>
#include <utility>
#include <vector>

#include "krot/analysis/model_statistics.h"
#include "krot/base/context.h"
#include "krot/base/write_file.h"
#include "krot/options/command_options.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/report/reports.h"
#include "krot/report/text_table.h"
#include "tools/krot/command.h"
#include "tools/krot/common_options.h"
#include "tools/krot/interrupt.h"
#include "tools/krot/model_files.h"
#include "tools/krot/report_files.h"
#include "tools/krot/solve_progress.h"
#include "tools/krot/suspect_crops.h"

namespace krot::internal {
namespace {

struct OutlierCommand {
  ModelPaths paths;
  std::string conflicts_path;
  std::string outliers_path;
  std::string profile_path;
  std::string image_path;
  std::string suspects_path;
  std::string overlay_path;
  Context context;
  OutlierFilterOptions options;
  CommonOptions common;
};

void AddOutlierOptions(OutlierCommand* command, OptionParser* parser) {
  AddModelPaths(&command->paths, parser);
  AddRotationsPath(&command->paths, parser);
  parser->AddOutputFile(
      "conflicts_path", &command->conflicts_path,
      "Where the conflicts go, as JSON: the proof of how many must go");
  parser->AddOutputFile("outliers_path", &command->outliers_path,
                        "Where the list of removed observations goes, as CSV");
  parser->AddPath("image_path", &command->image_path, false, "a folder",
                  "The photos: the page then shows the worst of what was "
                  "removed in them");
  parser->AddPath("suspects_path", &command->suspects_path, false, "a folder",
                  "Where a copy for COLMAP's GUI goes, with points coloured by "
                  "whether they lost observations or take part in conflicts");
  parser->AddPath(
      "overlay_path", &command->overlay_path, false, "a folder",
      "Where one model goes that holds input and result in two colours");
  AddOutlierFilterOptions(&command->options, &command->context, parser);
  parser->AddOutputFile("OutlierFilter.profile_path", &command->profile_path,
                        "Where the error profile goes, as JSON: the largest "
                        "error against the number removed; also on the page");
  AddCommonOptions(&command->common, parser);
}

void CheckPairs(const OptionParser& parser, OutlierCommand* resolved) {
  ResolveOutlierFilterOptions(parser, !resolved->profile_path.empty(),
                              &resolved->options);
  const OutlierCommand& command = *resolved;
  if (command.options.method != OutlierMethod::kConflicts) {
    parser.Refuse("OutlierFilter.profile_path",
                  "with --OutlierFilter.method snooping");
  }
  if (command.paths.html_path.empty()) {
    parser.Refuse("image_path", "without --html_path");
  }
}

OutlierFilterResult Filter(const OutlierCommand& command, const Model& model) {
  const LogOptions& log = command.common.log;
  OutlierFilterOptions options = command.options;
  options.make_profile = !command.profile_path.empty();
  if (!command.conflicts_path.empty()) options.find_conflicts = true;
  Context context = command.context;
  SolveProgress progress(log, SolveProgress::GoalsOf(options.solve));
  progress.Follow(&options.solve, &context);
  options.on_removed = [&](int64_t num_removed) {
    LogLine(log, 1,
            Counted(num_removed, "observation") +
                " to remove; solving what is left");
  };
  OutlierFilterResult result = FilterOutliers(model, options, context);
  EndProgress();
  return result;
}

// Checks what can be known before the model is read.
WriteModelOptions CheckPaths(const OutlierCommand& command) {
  const ModelPaths& paths = command.paths;
  const WriteModelOptions write_options =
      CheckModelPaths(paths, command.common.log);
  CheckSidePath("conflicts_path", command.conflicts_path, paths.output_path);
  CheckSidePath("outliers_path", command.outliers_path, paths.output_path);
  CheckSidePath("OutlierFilter.profile_path", command.profile_path,
                paths.output_path);
  CheckOwnFolder("suspects_path", command.suspects_path,
                 {paths.input_path, paths.output_path}, write_options);
  CheckOwnFolder("overlay_path", command.overlay_path,
                 {paths.input_path, paths.output_path, command.suspects_path},
                 write_options);
  return write_options;
}

// Writes models that are there to be looked at.
void WriteViews(const OutlierCommand& command,
                const OutlierFilterSummary& summary,
                const WriteModelOptions& write_options, const Model& input,
                const Model& result) {
  const LogOptions& log = command.common.log;
  if (!command.suspects_path.empty()) {
    BeginPhase(log, "writing " + command.suspects_path);
    Model colored = input;
    ColorSuspects(summary, &colored);
    WriteModel(colored, command.suspects_path, write_options);
  }
  if (!command.overlay_path.empty()) {
    BeginPhase(log, "writing " + command.overlay_path);
    WriteModel(OverlayModels(input, result, command.context.num_threads),
               command.overlay_path, write_options);
  }
}

void WriteSideFiles(const OutlierCommand& command,
                    const OutlierReport& report) {
  const LogOptions& log = command.common.log;
  const auto write = [&](const std::string& path, const std::string& text) {
    BeginPhase(log, "writing " + path);
    WriteFileAtomically(path, text);
  };
  if (!command.conflicts_path.empty() && report.summary.conflicts) {
    write(command.conflicts_path, ConflictJson(*report.summary.conflicts));
  }
  if (report.summary.profile) write(command.profile_path, ProfileJson(report));
  if (!command.outliers_path.empty()) {
    write(command.outliers_path, OutlierCsv(report.summary));
  }
}

int Run(const OutlierCommand& command) {
  const Timer total_timer;
  const LogOptions& log = command.common.log;
  const ModelPaths& paths = command.paths;
  const WriteModelOptions write_options = CheckPaths(command);
  OutlierReport report;
  report.run.seed = command.common.random_seed;

  const Model model = ReadInput(paths, log, &report.run);
  WarnOfConventions(paths, model, log);
  OutlierFilterResult result = Filter(command, model);
  DeferInterrupts();
  report.summary = std::move(result.summary);
  if (report.summary.snooping && !report.summary.snooping->sigma_px) {
    throw CommandError(
        kExitNothingToSolve,
        "nothing to solve: no observation is checked by another one, so that "
        "noise cannot be told from error; where the model has no positions, "
        "krot solver makes them, and --OutlierFilter.max_error PX filters "
        "without");
  }
  if (!HasTrack(result.model)) {
    throw CommandError(kExitNothingToSolve,
                       "nothing to solve: no track keeps two observations");
  }

  WriteOutput(result.model, paths, write_options, log, &report.run);
  RecordEnd(total_timer, command.context.num_threads, &report.run);
  WriteSideFiles(command, report);
  WriteViews(command, report.summary, write_options, model, result.model);
  const std::string report_json = OutlierJson(report);
  const std::string crops =
      command.image_path.empty()
          ? "[]"
          : SuspectCropsJson(command.image_path, model, result.model,
                             report.summary, log);
  WriteReports(paths.report_path, paths.html_path, report_json, model,
               result.model, command.context.num_threads, log, crops);
  PrintTable(log, OutlierTable(report));
  WarnOfDegeneration(model, result.model, log);
  if (!report.summary.is_within) {
    LogLine(log, 0, "warning: not all errors are within the bound");
  }
  const std::string unreliable = UnreliableSentence(report.summary);
  if (unreliable.empty()) return kExitDone;
  LogLine(log, 0, "warning: " + unreliable);
  return kExitUnreliable;
}

}  // namespace

int RunOutlierFilter(const std::vector<std::string>& arguments) {
  OutlierCommand command;
  OptionParser parser("outlier_filter",
                      "removes the observations of a COLMAP model that noise "
                      "does not explain, or few so that all others are within "
                      "a bound, and proves how many of those must go; "
                      "rotations, intrinsics and the coordinate frame stay");
  AddOutlierOptions(&command, &parser);
  if (!ParseOrPrintHelp(arguments, command.common.log, &parser))
    return kExitDone;
  CheckPairs(parser, &command);
  return Run(command);
}

}  // namespace krot::internal
