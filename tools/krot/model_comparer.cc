#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "krot/analysis/model_comparison.h"
#include "krot/analysis/model_statistics.h"
#include "krot/base/write_file.h"
#include "krot/convert/certificate_file.h"
#include "krot/report/reports.h"
#include "krot/version.h"
#include "tools/krot/command.h"
#include "tools/krot/common_options.h"
#include "tools/krot/interrupt.h"
#include "tools/krot/metres.h"
#include "tools/krot/model_files.h"
#include "tools/krot/report_files.h"
#include "tools/krot/same_path.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

// These files go to --output_path, under COLMAP's names.
constexpr char kErrorsName[] = "errors.csv";
constexpr char kTableName[] = "errors_summary.txt";

struct ComparerOptions {
  std::string input_path1;
  std::string input_path2;
  AlignmentKind alignment = AlignmentKind::kFrame;
  int num_worst = 10;
  std::string output_path;
  std::string report_path;
  std::string html_path;
  std::string certificate_path1;
  std::string certificate_path2;
  std::string distances_path;
  std::string overlay_path;
  std::string output_type = "BIN";
  bool overwrite = false;
  std::string on_contradiction = "auto";
  CommonOptions common;
};

void AddComparerOptions(ComparerOptions* options, OptionParser* parser) {
  parser->AddPath("input_path1", &options->input_path1, true, "a folder",
                  "The COLMAP model to compare with; its scene units are used");
  parser->AddPath("input_path2", &options->input_path2, true, "a folder",
                  "The COLMAP model to compare, of the same images by name");
  parser->AddNamed<AlignmentKind>(
      "alignment", &options->alignment,
      {{"frame", AlignmentKind::kFrame},
       {"similarity", AlignmentKind::kSimilarity},
       {"none", AlignmentKind::kNone}},
      "How the second model is aligned: frame: by mean rotation, centroid and "
      "radius of the cameras; similarity: by least squares of the camera "
      "centres; none: as stored");
  parser->AddInteger("num_worst", &options->num_worst, AtLeast(0),
                     "How many of the worst cameras, images and points to "
                     "list");
  parser->AddPath("output_path", &options->output_path, false, "a folder",
                  "Where errors.csv (per image, as COLMAP's) and "
                  "errors_summary.txt (the tables) go");
  parser->AddOutputFile("report_path", &options->report_path,
                        "Where the report goes, as JSON");
  AddHtmlPath(&options->html_path, parser);
  parser->AddPath("certificate_path1", &options->certificate_path1, false,
                  "a file",
                  "A certificate of the first model: show what it proves");
  parser->AddPath("certificate_path2", &options->certificate_path2, false,
                  "a file",
                  "A certificate of the second model: show what it proves");
  AddDistancesPath(&options->distances_path, parser);
  parser->AddPath("overlay_path", &options->overlay_path, false, "a folder",
                  "Where one model goes that holds both in two colours");
  parser->AddChoice("output_type", &options->output_type, {"BIN", "TXT"},
                    "The format of the overlay");
  AddOverwrite(&options->overwrite, parser);
  AddOnContradiction(&options->on_contradiction, parser);
  AddCommonOptions(&options->common, parser);
}

WriteModelOptions OverlayWriteOptions(const ComparerOptions& options) {
  WriteModelOptions write;
  write.format =
      options.output_type == "TXT" ? ModelFormat::kText : ModelFormat::kBinary;
  write.overwrite = options.overwrite;
  write.copy_project_from = options.input_path1;
  write.on_note = WarnOn(options.common.log);
  return write;
}

// Checks what can be known before the models are read.
void CheckComparerPaths(const ComparerOptions& options,
                        const OptionParser& parser) {
  if (options.overlay_path.empty()) {
    for (const char* name : {"output_type", "overwrite"}) {
      if (parser.IsGiven(name)) {
        throw OptionError("--" + std::string(name) +
                          " speaks of the overlay; give --overlay_path, too");
      }
    }
  } else {
    for (const std::string& input :
         {options.input_path1, options.input_path2}) {
      if (IsSamePath(input, options.overlay_path)) {
        throw OptionError("--overlay_path = " + options.overlay_path +
                          ", must not be a model that is compared");
      }
    }
    CheckWritable(options.overlay_path, OverlayWriteOptions(options));
  }
  if (!options.output_path.empty()) {
    const fs::path folder = options.output_path;
    const fs::path folder_to_come = fs::exists(folder) ? fs::path() : folder;
    for (const char* name : {kErrorsName, kTableName}) {
      CheckFileWritable(folder / name, folder_to_come);
      for (const auto& [option, path] :
           {std::pair("report_path", options.report_path),
            std::pair("html_path", options.html_path)}) {
        if (!IsSamePath((folder / name).string(), path)) continue;
        throw OptionError("--" + std::string(option) + " = " + path +
                          ", must not be " + name + " of --output_path");
      }
    }
  }
  CheckSidePath("report_path", options.report_path, options.overlay_path);
  CheckSidePath("html_path", options.html_path, options.overlay_path);
}

std::optional<CertificateVerdict> Verify(const Model& model,
                                         const std::string& path) {
  if (path.empty()) return std::nullopt;
  CertificateVerdict verdict =
      VerifyCertificateFile(model, ReadCertificateFile(path));
  if (!verdict.is_accepted) {
    throw CommandError(kExitCertificateRefused,
                       "refused: " + path + ": " + verdict.refusal);
  }
  return verdict;
}

// Why there is no alignment, and what to do.
std::string NoAlignmentSentence(const ComparerOptions& options,
                                size_t num_poses) {
  const std::string found = std::to_string(num_poses);
  if (options.alignment == AlignmentKind::kSimilarity) {
    return "--alignment similarity needs three images with a pose in both "
           "models, with centres that are not on one line; there are " +
           found + "; use --alignment frame or none";
  }
  return "--alignment frame needs images with a pose in both models, with "
         "rotations that have a mean; there are " +
         found + "; use --alignment none";
}

ComparisonSummary Compare(const ComparerOptions& options, const Model& model1,
                          const Model& model2) {
  const ModelCorrespondence correspondence = FindCorrespondence(model1, model2);
  if (correspondence.images.empty()) {
    throw CommandError(kExitNothingToSolve,
                       "the models share no image: no name of " +
                           options.input_path1 + " is one of " +
                           options.input_path2);
  }
  CompareModelsOptions compare;
  compare.alignment = options.alignment;
  compare.num_worst = options.num_worst;
  std::optional<ComparisonSummary> summary =
      CompareModels(model1, model2, correspondence, compare);
  if (!summary) {
    throw OptionError(NoAlignmentSentence(
        options, SharedPoses(model1, model2, correspondence).size()));
  }
  return *summary;
}

void WriteErrorFiles(const fs::path& folder, const ComparisonSummary& summary,
                     const std::string& table) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) {
    throw WriteError(folder.string() +
                     " cannot be created: " + error.message());
  }
  WriteFileAtomically(folder / kErrorsName, PoseErrorsCsv(summary));
  WriteFileAtomically(folder / kTableName, table);
}

}  // namespace

int RunModelComparer(const std::vector<std::string>& arguments) {
  ComparerOptions options;
  OptionParser parser("model_comparer",
                      "shows how two COLMAP models of the same images differ: "
                      "poses, points and reprojection errors");
  AddComparerOptions(&options, &parser);
  if (!ParseOrPrintHelp(arguments, options.common.log, &parser))
    return kExitDone;
  CheckComparerPaths(options, parser);
  const auto [model1, contradictions1, poses1] = ReadValidModel(
      options.input_path1, options.on_contradiction, options.common.log);
  const auto [model2, contradictions2, poses2] = ReadValidModel(
      options.input_path2, options.on_contradiction, options.common.log);

  BeginPhase(options.common.log, "comparing the models");
  ComparisonReport report;
  report.contradictions1 = contradictions1;
  report.contradictions2 = contradictions2;
  report.version = KROT_VERSION;
  report.certificate1 = Verify(model1, options.certificate_path1);
  report.certificate2 = Verify(model2, options.certificate_path2);
  report.summary = Compare(options, model1, model2);
  report.distances = MeasureFile(options.distances_path, {&model1, &model2},
                                 options.common.log);
  const std::string table = ComparisonTable(report, options.num_worst);

  const Model aligned =
      TransformModel(model2, report.summary.world1_from_world2);
  DeferInterrupts();
  if (!options.overlay_path.empty()) {
    WriteModel(OverlayModels(model1, aligned), options.overlay_path,
               OverlayWriteOptions(options));
  }
  if (!options.output_path.empty()) {
    WriteErrorFiles(options.output_path, report.summary, table);
  }
  WriteReports(options.report_path, options.html_path, ComparisonJson(report),
               model1, aligned, -1, options.common.log);
  PrintTable(options.common.log, table);
  return kExitDone;
}

}  // namespace krot::internal
