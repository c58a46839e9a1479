#include "tools/krot/html_path.h"

#include "krot/base/write_file.h"
#include "krot/report/html_page.h"
#include "tools/krot/model_files.h"

namespace krot {

void AddHtmlPath(std::string* html_path, OptionParser* parser) {
  parser->AddOutputFile(
      "html_path", html_path,
      "Where the report goes as a page to look at: figures, charts "
      "and both models in 3D, in one HTML file");
}

void WriteHtmlPage(const std::string& html_path, const std::string& report_json,
                   const Model& before, const Model& after, int num_threads,
                   const LogOptions& log) {
  if (html_path.empty()) return;
  LogLine(log, 2, "writing " + html_path);
  WriteFileAtomically(html_path,
                      HtmlPage(report_json, before, after, num_threads));
}

}  // namespace krot
