#include <string>
#include <vector>

#include "krot/report/model_report.h"
#include "krot/report/write_file.h"
#include "tools/command.h"
#include "tools/common_options.h"
#include "tools/model_files.h"

namespace krot {
namespace {

struct AnalyzerOptions {
  std::string path;
  std::string input_path;
  std::string report_path;
  int num_worst = 10;
  CommonOptions common;
};

void AddAnalyzerOptions(AnalyzerOptions* options, OptionParser* parser) {
  parser->AddPath("path", &options->path, false, "a folder",
                  "The COLMAP model to read; this or --input_path is required");
  parser->AddPath("input_path", &options->input_path, false, "a folder",
                  "Another name for --path");
  parser->AddInteger("num_worst", &options->num_worst, AtLeast(0),
                     "How many of the worst images and observations to list");
  parser->AddPath("report_path", &options->report_path, false, "a file",
                  "Where the report goes, as JSON");
  AddCommonOptions("Accepted everywhere; this command draws no random numbers",
                   &options->common, parser);
}

// The path under either of its names.
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

}  // namespace

int RunModelAnalyzer(const std::vector<std::string>& arguments) {
  AnalyzerOptions options;
  OptionParser parser("model_analyzer",
                      "shows a COLMAP model's reprojection errors by image "
                      "and camera, its worst observations, tracks and depths");
  AddAnalyzerOptions(&options, &parser);
  if (!parser.Parse(arguments)) {
    PrintTable(options.common.log, parser.Help());
    return kExitDone;
  }
  const std::string path = ModelPath(options, parser);
  if (!options.report_path.empty()) {
    CheckReportName(options.report_path);
    CheckFileWritable(options.report_path);
  }
  const ModelReport report =
      AnalyzeModel(ReadValidModel(path), options.num_worst);
  if (!options.report_path.empty()) {
    WriteFileAtomically(options.report_path, ModelJson(report, KROT_VERSION));
  }
  PrintTable(options.common.log, ModelTable(report, options.num_worst));
  return kExitDone;
}

}  // namespace krot
