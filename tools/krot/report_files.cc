#include "tools/krot/report_files.h"

#include "krot/base/write_file.h"
#include "krot/report/html_page.h"

namespace krot::internal {

void AddHtmlPath(std::string* html_path, OptionParser* parser) {
  parser->AddOutputFile("html_path", html_path,
                        "Where the report goes as one HTML file, with charts "
                        "and both models in 3D");
}

void WriteReports(const std::string& report_path, const std::string& html_path,
                  const std::string& report_json, const Model& before,
                  const Model& after, int num_threads, const LogOptions& log,
                  const std::string& crops_json,
                  const std::string& pairs_json) {
  if (!report_path.empty()) {
    BeginPhase(log, "writing " + report_path);
    WriteFileAtomically(report_path, report_json);
  }
  if (!html_path.empty()) {
    BeginPhase(log, "writing " + html_path);
    WriteFileAtomically(
        html_path, HtmlPage(report_json, before, after, num_threads, crops_json,
                            pairs_json));
  }
}

}  // namespace krot::internal
