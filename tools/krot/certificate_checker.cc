#include <optional>
#include <string>
#include <vector>

#include "krot/base/write_file.h"
#include "krot/convert/certificate_file.h"
#include "krot/report/reports.h"
#include "krot/version.h"
#include "tools/krot/command.h"
#include "tools/krot/common_options.h"
#include "tools/krot/model_files.h"

namespace krot::internal {
namespace {

struct CheckerOptions {
  std::string input_path;
  std::string certificate_path;
  std::string database_path;
  std::string on_contradiction = "auto";
  std::string report_path;
  int num_worst = 10;
  CommonOptions common;
};

void AddCheckerOptions(CheckerOptions* options, OptionParser* parser) {
  parser->AddPath("input_path", &options->input_path, true, "a folder",
                  "The COLMAP model that the certificate speaks of");
  parser->AddPath("certificate_path", &options->certificate_path, true,
                  "a file", "The certificate, conflicts or baselines, as JSON");
  parser->AddPath(
      "database_path", &options->database_path, false, "a file",
      "With baselines: the database whose verified matches they speak of");
  parser->AddOutputFile("report_path", &options->report_path,
                        "Where the report goes, as JSON");
  AddOnContradiction(&options->on_contradiction, parser);
  parser->AddInteger("num_worst", &options->num_worst, AtLeast(0),
                     "How many observations of the support to list");
  AddCommonOptions(&options->common, parser);
}

Model ReadSubject(const CheckerOptions& options) {
  Model model = ReadValidModel(options.input_path, options.on_contradiction,
                               options.common.log)
                    .model;
  BeginPhase(options.common.log, "checking the proof");
  return model;
}

void WriteReport(const CheckerOptions& options,
                 const std::optional<CertificateVerdict>& certificate,
                 const std::optional<ConflictVerdict>& conflicts,
                 const std::optional<BaselineCertificate>& baselines) {
  if (options.report_path.empty()) return;
  WriteFileAtomically(options.report_path, CheckJson(certificate, conflicts,
                                                     baselines, KROT_VERSION));
}

template <typename Verdict>
void RequireAccepted(const Verdict& verdict) {
  if (verdict.is_accepted) return;
  throw CommandError(kExitCertificateRefused, "refused: " + verdict.refusal);
}

int CheckCertificate(const CheckerOptions& options, const std::string& json) {
  const CertificateFile file = ParseCertificate(json, options.certificate_path);
  const CertificateVerdict verdict =
      VerifyCertificateFile(ReadSubject(options), file);
  RequireAccepted(verdict);
  WriteReport(options, verdict, std::nullopt, std::nullopt);
  PrintTable(options.common.log, CertificateTable(verdict, options.num_worst));
  return kExitDone;
}

int CheckConflicts(const CheckerOptions& options, const std::string& json) {
  const ConflictFile file = ParseConflicts(json, options.certificate_path);
  const ConflictVerdict verdict =
      VerifyConflictFile(ReadSubject(options), file);
  RequireAccepted(verdict);
  WriteReport(options, std::nullopt, verdict, std::nullopt);
  PrintTable(options.common.log, ConflictTable(verdict));
  return kExitDone;
}

int CheckBaselines(const CheckerOptions& options, const std::string& json) {
  const BaselineCertificate file =
      ParseBaselines(json, options.certificate_path);
  if (options.database_path.empty()) {
    throw OptionError(
        "--database_path is required with a certificate of "
        "baselines: it speaks of verified matches");
  }
  const Model model = ReadSubject(options);
  const Database database =
      ReadDatabase(options.database_path, model, WarnOn(options.common.log));
  RequireAccepted(VerifyBaselines(model, database, file));
  WriteReport(options, std::nullopt, std::nullopt, file);
  PrintTable(options.common.log, BaselineTable(model, file, options.num_worst));
  return kExitDone;
}

}  // namespace

int RunCertificateChecker(const std::vector<std::string>& arguments) {
  CheckerOptions options;
  OptionParser parser("certificate_checker",
                      "re-checks the proof that no translations and points "
                      "have a smaller largest error, or that so many "
                      "observations must go, or that no baselines explain "
                      "more matches, from a COLMAP model and the certificate's "
                      "file alone");
  AddCheckerOptions(&options, &parser);
  if (!ParseOrPrintHelp(arguments, options.common.log, &parser))
    return kExitDone;
  CheckSidePath("report_path", options.report_path);
  const std::string json = ReadCertificateText(options.certificate_path);
  if (HoldsBaselines(json)) return CheckBaselines(options, json);
  parser.Refuse("database_path", "without a certificate of baselines");
  return HoldsConflicts(json) ? CheckConflicts(options, json)
                              : CheckCertificate(options, json);
}

}  // namespace krot::internal
