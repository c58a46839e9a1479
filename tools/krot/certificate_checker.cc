#include <limits>
#include <string>
#include <vector>

#include "krot/bridge/certificate_verdict.h"
#include "krot/report/certificate_table.h"
#include "tools/krot/command.h"
#include "tools/krot/common_options.h"
#include "tools/krot/model_files.h"

namespace krot {
namespace {

struct CheckerOptions {
  std::string input_path;
  std::string certificate_path;
  std::string on_contradiction = "follow_tracks";
  CommonOptions common;
};

void AddCheckerOptions(CheckerOptions* options, OptionParser* parser) {
  parser->AddPath("input_path", &options->input_path, true, "a folder",
                  "The COLMAP model that the certificate speaks of");
  parser->AddPath("certificate_path", &options->certificate_path, true,
                  "a file", "The certificate, as JSON");
  AddOnContradiction(&options->on_contradiction, parser);
  AddCommonOptions("Accepted everywhere; this command draws no random numbers",
                   &options->common, parser);
}

}  // namespace

int RunCertificateChecker(const std::vector<std::string>& arguments) {
  CheckerOptions options;
  OptionParser parser("certificate_checker",
                      "re-checks the proof that no translations and points "
                      "have a smaller largest error, from a COLMAP model and "
                      "the certificate's file alone");
  AddCheckerOptions(&options, &parser);
  if (!parser.Parse(arguments)) {
    PrintTable(options.common.log, parser.Help());
    return kExitDone;
  }
  const CertificateFile file = ReadCertificateFile(options.certificate_path);
  const ValidModel read = ReadValidModel(
      options.input_path, options.on_contradiction, options.common.log);
  const CertificateVerdict verdict = VerifyCertificateFile(read.model, file);
  if (!verdict.is_accepted) {
    throw CommandError(kExitCertificateRefused, "refused: " + verdict.refusal);
  }
  PrintTable(options.common.log,
             CertificateTable(verdict, std::numeric_limits<int>::max()));
  return kExitDone;
}

}  // namespace krot
