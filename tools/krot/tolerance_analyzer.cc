#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/write_file.h"
#include "krot/options/command_options.h"
#include "krot/report/reports.h"
#include "krot/report/text_table.h"
#include "tools/krot/command.h"
#include "tools/krot/common_options.h"
#include "tools/krot/interrupt.h"
#include "tools/krot/model_files.h"
#include "tools/krot/report_files.h"
#include "tools/krot/run_log.h"
#include "tools/krot/solve_progress.h"

namespace krot::internal {
namespace {

struct ToleranceCommand {
  ModelPaths paths;  // without an output
  std::string csv_path;
  std::string distances_path;
  int num_worst = 10;
  Context context;
  ToleranceArguments arguments;
  CommonOptions common;
};

void AddCommandOptions(ToleranceCommand* command, OptionParser* parser) {
  ModelPaths* paths = &command->paths;
  parser->AddPath("input_path", &paths->input_path, true, "a folder",
                  "The COLMAP model to read, binary or text");
  AddToleranceOptions(&command->arguments, &command->context, parser);
  parser->AddPath("ToleranceAnalyzer.distances", &command->distances_path,
                  false, "a file",
                  "Whose least and greatest lengths are asked for: lines of "
                  "two images or two 3D points, and METRES TOLERANCE where "
                  "known; the first known one is the scale bar");
  AddRotationsPath(paths, parser);
  AddFixedPaths(paths, parser);
  parser->AddOutputFile("report_path", &paths->report_path,
                        "Where the report goes, as JSON");
  parser->AddOutputFile("csv_path", &command->csv_path,
                        "Where the boxes go, as CSV");
  parser->AddInteger("num_worst", &command->num_worst, AtLeast(0),
                     "How many boxes to list at most, the widest");
  AddHtmlPath(&paths->html_path, parser);
  AddOnContradiction(&paths->on_contradiction, parser);
  AddCommonOptions(&command->common, parser);
}

void CheckPairs(const OptionParser& parser) {
  for (const char* name : {"fixed_images_path", "fixed_points_path"}) {
    if (!parser.IsGiven(name)) continue;
    parser.Refuse("ToleranceAnalyzer.gauge_images",
                  "with --" + std::string(name) + ", which holds the rest");
  }
}

[[noreturn]] void ThrowWithoutEstimate(const ToleranceSummary& summary) {
  const std::string bound = "--ToleranceAnalyzer.max_error " +
                            FormatNumber(summary.max_error, 6) + " px";
  if (summary.lower_bound && *summary.lower_bound >= summary.max_error) {
    throw CommandError(kExitNoStart,
                       "no estimate is within " + bound +
                           ": its largest error is proved to be at least " +
                           FormatNumber(*summary.lower_bound, 6) + " px");
  }
  throw CommandError(kExitNoStart, "no estimate was found below " + bound +
                                       "; the best one has " +
                                       FormatNumber(summary.cost, 6) + " px");
}

ToleranceResult Analyze(const ToleranceCommand& command, const Model& model) {
  const LogOptions& log = command.common.log;
  ToleranceOptions options = ResolveToleranceOptions(command.arguments, model);
  options.solve.problem.fixed = ReadFixedParts(command.paths, model, log);
  if (!command.distances_path.empty()) {
    LogInput(command.distances_path);
    options.distances = ReadDistances(ReadFileBytes(command.distances_path),
                                      model, true, WarnOn(log));
    if (command.arguments.images.empty() && command.arguments.points.empty()) {
      options.images.clear();
    }
  }
  const auto num_boxes = static_cast<int64_t>(
      options.images.size() + options.points.size() + options.distances.size());
  options.on_box = [&](int64_t num_done) {
    ShowProgress(
        log, {"boxes",
              (options.distances.empty() ? "box " : "box or length ") +
                  std::to_string(std::min(num_done + 1, num_boxes)) + " of " +
                  std::to_string(num_boxes),
              static_cast<double>(num_done) / static_cast<double>(num_boxes)});
  };
  const auto num_lengths = static_cast<int64_t>(options.distances.size());
  const std::string ends = Counted(6 * (num_boxes - num_lengths), "end");
  const std::string lengths = Counted(num_lengths, "length");
  LogLine(
      log, 1,
      "looking for " + (num_lengths == 0           ? ends
                        : num_lengths == num_boxes ? lengths
                                                   : ends + " and " + lengths));
  BeginPhase(log, "looking for an estimate within the bound");
  Context context = command.context;
  SolveProgress progress(log, SolveProgress::GoalsOf(options.solve));
  progress.Follow(&options.solve, &context);
  ToleranceResult result = AnalyzeTolerances(model, options, context);
  EndProgress();
  switch (result.summary.termination) {
    case ToleranceTermination::kNothingToSolve:
      throw CommandError(kExitNothingToSolve,
                         "nothing to analyze: no observation can be used");
    case ToleranceTermination::kNoEstimate:
      ThrowWithoutEstimate(result.summary);
    default:
      return result;
  }
}

int Run(const ToleranceCommand& command) {
  const Timer total_timer;
  const LogOptions& log = command.common.log;
  const ModelPaths& paths = command.paths;
  CheckSidePath("report_path", paths.report_path);
  CheckSidePath("csv_path", command.csv_path);
  CheckSidePath("html_path", paths.html_path);
  ToleranceReport report;
  report.run.seed = command.common.random_seed;
  const Model model = ReadInput(paths, log, &report.run);
  WarnOfConventions(paths, model, log);
  ToleranceResult result = Analyze(command, model);
  DeferInterrupts();
  report.summary = std::move(result.summary);
  const int num_threads = command.context.num_threads;
  report.pixel_error_before = Summarize(PixelErrors(model, num_threads));
  report.pixel_error_after = Summarize(PixelErrors(result.model, num_threads));
  RecordEnd(total_timer, num_threads, &report.run);
  if (!command.csv_path.empty()) {
    BeginPhase(log, "writing " + command.csv_path);
    WriteFileAtomically(command.csv_path, ToleranceCsv(report.summary));
  }
  WriteReports(paths.report_path, paths.html_path, ToleranceJson(report), model,
               result.model, num_threads, log);
  PrintTable(log, ToleranceTable(report, command.num_worst));
  return kExitDone;
}

}  // namespace

int RunToleranceAnalyzer(const std::vector<std::string>& arguments) {
  ToleranceCommand command;
  OptionParser parser(
      "tolerance_analyzer",
      "shows not where cameras and points are, but everywhere they may be: the "
      "smallest and the largest value of each coordinate over all estimates "
      "within a bound, proved; rotations and intrinsics as given. It is no "
      "covariance, and says nothing about rotations that are wrong");
  AddCommandOptions(&command, &parser);
  if (!ParseOrPrintHelp(arguments, command.common.log, &parser))
    return kExitDone;
  CheckPairs(parser);
  return Run(command);
}

}  // namespace krot::internal
