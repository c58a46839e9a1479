#include <string>
#include <vector>

#include "krot/analysis/model_statistics.h"
#include "krot/base/write_file.h"
#include "krot/context.h"
#include "krot/convert/certificate_file.h"
#include "krot/model.h"
#include "krot/report/reports.h"
#include "krot/report/sentences.h"
#include "krot/version.h"
#include "tools/krot/command.h"
#include "tools/krot/common_options.h"
#include "tools/krot/interrupt.h"
#include "tools/krot/metres.h"
#include "tools/krot/model_files.h"
#include "tools/krot/same_path.h"

namespace krot::internal {
namespace {

struct AnalyzerOptions {
  std::string path;
  std::string input_path;
  std::string report_path;
  std::string csv_path;
  std::string certificate_path;
  std::string distances_path;
  std::string error_colors_path;
  double error_colors_top = 4;
  bool overwrite = false;
  std::string on_contradiction = "auto";
  int num_worst = 10;
  CommonOptions common;
};

void AddAnalyzerOptions(AnalyzerOptions* options, OptionParser* parser) {
  parser->AddPath("path", &options->path, false, "a folder",
                  "The COLMAP model to read; this or --input_path is required");
  parser->AddPath("input_path", &options->input_path, false, "a folder",
                  "Another name for --path");
  parser->AddInteger("num_worst", &options->num_worst, AtLeast(0),
                     "How many of the worst cameras, images and observations "
                     "to list");
  parser->AddOutputFile("report_path", &options->report_path,
                        "Where the report goes, as JSON");
  parser->AddOutputFile("csv_path", &options->csv_path,
                        "Where the errors of all cameras and images go, as "
                        "CSV");
  parser->AddPath("certificate_path", &options->certificate_path, false,
                  "a file", "A certificate of this model: show what it proves");
  AddDistancesPath(&options->distances_path, parser);
  parser->AddPath("error_colors_path", &options->error_colors_path, false,
                  "a folder",
                  "Where a copy for COLMAP's GUI goes, with points coloured by "
                  "their largest error");
  parser->AddReal("error_colors_top", &options->error_colors_top,
                  Above(0.0, "pixels"),
                  "The error from which on the copy's points are dark red");
  AddOverwrite(&options->overwrite, parser);
  AddOnContradiction(&options->on_contradiction, parser);
  AddCommonOptions(&options->common, parser);
}

// The model's path, under whichever of its two names.
std::string ModelPath(const AnalyzerOptions& options,
                      const OptionParser& parser) {
  if (parser.IsGiven("path") && parser.IsGiven("input_path")) {
    throw OptionError("--path and --input_path are the same; give one");
  }
  if (!parser.IsGiven("path") && !parser.IsGiven("input_path")) {
    throw OptionError(
        "--path is required (krot model_analyzer -h lists the options)");
  }
  return parser.IsGiven("path") ? options.path : options.input_path;
}

WriteModelOptions CopyOptions(const AnalyzerOptions& options,
                              const std::string& input_path) {
  WriteModelOptions write_options;
  write_options.overwrite = options.overwrite;
  write_options.copy_project_from = input_path;
  write_options.on_note = WarnOn(options.common.log);
  return write_options;
}

// Checks what can be known before the model is read.
void CheckAnalyzerPaths(const AnalyzerOptions& options,
                        const std::string& input_path,
                        const OptionParser& parser) {
  CheckSidePath("report_path", options.report_path, options.error_colors_path);
  CheckSidePath("csv_path", options.csv_path, options.error_colors_path);
  if (!options.error_colors_path.empty()) {
    if (IsSamePath(input_path, options.error_colors_path)) {
      throw OptionError("--error_colors_path = " + options.error_colors_path +
                        ", must not be the model itself");
    }
    CheckWritable(options.error_colors_path, CopyOptions(options, input_path));
    return;
  }
  for (const char* name : {"error_colors_top", "overwrite"}) {
    if (!parser.IsGiven(name)) continue;
    throw OptionError("--" + std::string(name) +
                      " speaks of the copy; give --error_colors_path, too");
  }
}

void WriteColoredCopy(const AnalyzerOptions& options,
                      const std::string& input_path, Model model) {
  const std::vector<double> errors_px = PixelErrors(model);
  UpdatePointErrors(errors_px, &model);
  ColorPointsByError(errors_px, options.error_colors_top, &model);
  WriteModel(model, options.error_colors_path,
             CopyOptions(options, input_path));
}

// A model whose tracks cannot be followed is shown as its images have it.
ValidModel ReadToShow(const std::string& path, const AnalyzerOptions& options,
                      const OptionParser& parser) {
  try {
    return ReadValidModel(path, options.on_contradiction, options.common.log);
  } catch (const ModelError&) {
    if (parser.IsGiven("Model.on_contradiction")) throw;
  }
  return ReadValidModel(path, "follow_images", options.common.log);
}

// What the certificate says about the model; "" if none is given.
std::string CertificateText(const AnalyzerOptions& options,
                            const Model& model) {
  if (options.certificate_path.empty()) return "";
  const CertificateVerdict verdict = VerifyCertificateFile(
      model, ReadCertificateFile(options.certificate_path));
  if (!verdict.is_accepted) {
    throw CommandError(kExitCertificateRefused, "refused: " + verdict.refusal);
  }
  return "\n" + CertificateTable(verdict, options.num_worst);
}

}  // namespace

int RunModelAnalyzer(const std::vector<std::string>& arguments) {
  AnalyzerOptions options;
  OptionParser parser("model_analyzer",
                      "shows a COLMAP model's reprojection errors by image "
                      "and camera, its worst observations, tracks and depths");
  AddAnalyzerOptions(&options, &parser);
  if (!ParseOrPrintHelp(arguments, options.common.log, &parser))
    return kExitDone;
  const std::string path = ModelPath(options, parser);
  CheckAnalyzerPaths(options, path, parser);
  const auto [model, contradictions, poses] = ReadToShow(path, options, parser);
  if (model.track_elements.empty()) {
    LogLine(options.common.log, 1, std::string("warning: ") + kNoObservations);
  }
  BeginPhase(options.common.log, "measuring its errors");
  const std::string certificate = CertificateText(options, model);
  ModelReport report = AnalyzeModel(model, options.num_worst);
  report.contradictions = contradictions;
  report.distances =
      MeasureFile(options.distances_path, {&model}, options.common.log);
  report.poses = poses;
  DeferInterrupts();
  if (!options.error_colors_path.empty()) {
    WriteColoredCopy(options, path, model);
  }
  if (!options.report_path.empty()) {
    WriteFileAtomically(options.report_path, ModelJson(report, KROT_VERSION));
  }
  if (!options.csv_path.empty()) {
    WriteFileAtomically(options.csv_path, ModelCsv(report));
  }
  PrintTable(options.common.log,
             ModelTable(report, options.num_worst) + certificate);
  return kExitDone;
}

}  // namespace krot::internal
