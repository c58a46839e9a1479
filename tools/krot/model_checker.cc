#include <optional>
#include <string>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/write_file.h"
#include "krot/check.h"
#include "krot/convert/certificate_file.h"
#include "krot/database.h"
#include "krot/model/derived_models.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/report/reports.h"
#include "tools/krot/command.h"
#include "tools/krot/common_options.h"
#include "tools/krot/interrupt.h"
#include "tools/krot/model_files.h"
#include "tools/krot/report_files.h"
#include "tools/krot/suspect_crops.h"

namespace krot::internal {
namespace {

struct CheckerCommand {
  ModelPaths paths;
  std::string database_path;
  std::string image_path;
  std::string suspects_path;
  std::string certificate_path;
  std::string fail_on = "never";
  int num_worst = 10;
  Context context;
  CommonOptions common;
};

void AddCheckerOptions(CheckerCommand* command, OptionParser* parser) {
  AddModelPaths(&command->paths, parser,
                "Where the model without wrong images and observations goes");
  parser->AddPath("database_path", &command->database_path, false, "a file",
                  "The database that the model was made from: check its "
                  "verified matches against the poses");
  parser->AddPath("image_path", &command->image_path, false, "a folder",
                  "The photos: the page then shows the worst observations in "
                  "them and, with database_path, the matches of pairs");
  parser->AddPath("suspects_path", &command->suspects_path, false, "a folder",
                  "Where a copy for COLMAP's GUI goes, with points coloured by "
                  "whether an observation of theirs is wrong");
  parser->AddOutputFile("certificate_path", &command->certificate_path,
                        "With database_path: where the proof goes, as JSON, of "
                        "how many matches any baselines explain");
  parser->AddChoice("fail_on", &command->fail_on, {"never", "wrong"},
                    "When to end with code 9, for scripts: wrong: if an image "
                    "or an observation is wrong, or the model not adjusted");
  parser->AddInteger("num_worst", &command->num_worst, AtLeast(0),
                     "How many images of each verdict, observations and tracks "
                     "to list");
  parser->AddThreads("num_threads", &command->context.num_threads,
                     "the result is the same, bit by bit");
  AddCommonOptions(&command->common, parser);
}

// Checks what can be known before the model is read.
WriteModelOptions CheckPaths(const CheckerCommand& command,
                             const OptionParser& parser) {
  const ModelPaths& paths = command.paths;
  if (paths.html_path.empty()) {
    parser.Refuse("image_path", "without --html_path");
  }
  if (command.database_path.empty()) {
    parser.Refuse("certificate_path", "without --database_path");
  }
  CheckSidePath("certificate_path", command.certificate_path,
                paths.output_path);
  WriteModelOptions write_options;
  if (!paths.output_path.empty()) {
    write_options = CheckModelPaths(paths, command.common.log);
  } else {
    parser.Refuse("output_type", "without --output_path");
    if (command.suspects_path.empty()) {
      parser.Refuse("overwrite", "without --output_path");
    }
    CheckSidePath("report_path", paths.report_path);
    CheckSidePath("html_path", paths.html_path);
    write_options.format = DetectModelFormat(paths.input_path);
    write_options.overwrite = paths.overwrite;
    write_options.copy_project_from = paths.input_path;
    write_options.on_note = WarnOn(command.common.log);
  }
  CheckOwnFolder("suspects_path", command.suspects_path,
                 {paths.input_path, paths.output_path}, write_options);
  return write_options;
}

// Lists the wrong observations as if a filter had removed them, to show them
// alike.
OutlierFilterSummary Suspects(const ModelCheck& check) {
  OutlierFilterSummary summary;
  for (const WrongObservation& one : check.observations) {
    RemovedObservation& removed = summary.removed.emplace_back();
    removed.image_id = one.image_id;
    removed.image_name = one.image_name;
    removed.point2D_idx = one.point2D_idx;
    removed.point3D_id = one.point3D_id;
  }
  return summary;
}

void WriteViews(const CheckerCommand& command, const CheckReport& report,
                const WriteModelOptions& write_options, const Model& model,
                const Model& cured, const std::optional<Database>& database) {
  const LogOptions& log = command.common.log;
  const OutlierFilterSummary suspects = Suspects(report.check);
  if (!command.suspects_path.empty()) {
    BeginPhase(log, "writing " + command.suspects_path);
    Model colored = model;
    ColorSuspects(suspects, &colored);
    WriteModel(colored, command.suspects_path, write_options);
  }
  std::string crops = "[]";
  if (!command.image_path.empty()) {
    Model moved = report.check.conventions
                      ? ConvertModel(model, *report.check.conventions)
                      : model;
    for (size_t k = 0; k < moved.points3D.size(); ++k) {
      moved.points3D[k].xyz = report.check.points[k];
    }
    crops = SuspectCropsJson(command.image_path, model, moved, suspects, log);
  }
  std::string pairs = "null";
  if (database && !command.paths.html_path.empty()) {
    BeginPhase(log, "taking the page's photos");
    pairs = PairViewWithPhotos(command.image_path, model, *database,
                               *report.check.pairs, log);
  }
  WriteReports(command.paths.report_path, command.paths.html_path,
               CheckJson(report), model, cured, command.context.num_threads,
               log, crops, pairs);
}

bool HasDecidedPair(const ModelCheck& check) {
  return check.pairs &&
         check.pairs->num_kept + check.pairs->num_contradictory > 0;
}

int Run(const CheckerCommand& command, const OptionParser& parser) {
  const Timer total_timer;
  const LogOptions& log = command.common.log;
  const ModelPaths& paths = command.paths;
  const WriteModelOptions write_options = CheckPaths(command, parser);
  CheckReport report;
  report.run.seed = command.common.random_seed;
  report.input_path = paths.input_path;
  report.output_path = paths.output_path;
  report.database_path = command.database_path;
  report.image_path = command.image_path;
  const Model model =
      ReadInput(paths, log, &report.run, command.database_path.empty());

  report.has_panorama = HasPanorama(model);
  std::optional<Database> database;
  ModelCheckOptions options;
  if (!command.database_path.empty()) {
    BeginPhase(log, "reading " + command.database_path);
    database = ReadDatabase(command.database_path, model, WarnOn(log));
    options.database = &*database;
  }
  BeginPhase(log, "checking its images and observations");
  const Timer check_timer;
  report.check = CheckModel(model, options, command.context);
  if (!report.check.conventions) report.discarded = FindDiscardedCameras(model);
  if (!report.check.sigma_px && !HasDecidedPair(report.check)) {
    throw CommandError(
        kExitNothingToSolve,
        "nothing to check: no observation is checked by another one, as there "
        "are no positions, no tracks of two and more images, or no more "
        "coordinates than unknowns; krot solver makes positions from rotations "
        "and tracks");
  }
  const ModelCure cure =
      CureModel(model, report.check, options, command.context);
  const Model& cured = cure.model;
  report.moved = cure.moved;
  report.num_observations = static_cast<int64_t>(model.track_elements.size());
  const int num_threads = command.context.num_threads;
  report.pixel_error_before = Summarize(PixelErrors(model, num_threads));
  report.pixel_error_after = Summarize(PixelErrors(cured, num_threads));
  report.seconds_check = check_timer.Seconds();
  DeferInterrupts();
  if (!paths.output_path.empty()) {
    if (cured.track_elements.empty() && !model.track_elements.empty()) {
      throw CommandError(kExitNothingToSolve,
                         "nothing is left to write: every track contradicts "
                         "itself; no model was written");
    }
    WriteOutput(cured, paths, write_options, log, &report.run);
  }
  if (!command.certificate_path.empty()) {
    BeginPhase(log, "writing " + command.certificate_path);
    const BaselineCertificate proof =
        DescribeBaselines(model, *report.check.pairs);
    if (VerifyBaselines(model, *database, proof).is_accepted) {
      WriteFileAtomically(command.certificate_path, BaselineJson(proof));
    } else {
      LogLine(log, 0,
              "warning: there is no certificate, so " +
                  command.certificate_path + " is not written");
    }
  }
  RecordEnd(total_timer, num_threads, &report.run);
  WriteViews(command, report, write_options, model, cured, database);
  PrintTable(log, CheckTable(report, command.num_worst));
  const ModelCheck& check = report.check;
  const bool is_unknown = !check.is_adjusted;
  const bool fails =
      command.fail_on == "wrong" && (check.IsAnythingWrong() || is_unknown);
  return fails ? kExitWrong : kExitDone;
}

}  // namespace

int RunModelChecker(const std::vector<std::string>& arguments) {
  CheckerCommand command;
  OptionParser parser("model_checker",
                      "says which images and observations of a COLMAP model "
                      "are wrong, which images are weakly held, and what to do "
                      "next; writes the model without what is wrong");
  AddCheckerOptions(&command, &parser);
  if (!ParseOrPrintHelp(arguments, command.common.log, &parser))
    return kExitDone;
  return Run(command, parser);
}

}  // namespace krot::internal
