#pragma once

#include <string>

#include "krot/model.h"
#include "tools/krot/log.h"
#include "tools/krot/option_parser.h"

namespace krot::internal {

// Adds --html_path, which all commands with a report have.
void AddHtmlPath(std::string* html_path, OptionParser* parser);

// Writes the report and its page (HtmlPage), each unless its path is "". Throws
// WriteError.
void WriteReports(const std::string& report_path, const std::string& html_path,
                  const std::string& report_json, const Model& before,
                  const Model& after, int num_threads, const LogOptions& log,
                  const std::string& crops_json = "[]",
                  const std::string& pairs_json = "null");

}  // namespace krot::internal
