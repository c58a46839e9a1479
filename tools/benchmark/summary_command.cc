// krot_benchmark summary: the requirements, and what run_all.sh measured.

#include <filesystem>
#include <fstream>

#include "tools/benchmark/benchmark_command.h"
#include "tools/benchmark/benchmark_options.h"
#include "tools/benchmark/summary.h"
#include "tools/krot/command_error.h"

namespace krot::internal {
namespace {

Reports ReadReports(const std::string& folder) {
  Reports reports;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".json") continue;
    std::ifstream stream(entry.path());
    reports[entry.path().stem()] = nlohmann::ordered_json::parse(stream);
  }
  return reports;
}

}  // namespace

int RunSummaryBenchmark(const std::vector<std::string>& arguments) {
  BenchmarkOptions options;
  OptionParser parser =
      MakeBenchmarkParser("summary", "compares what was asked with reports");
  std::string folder;
  parser.AddPath("report_path", &folder, true, "a folder",
                 "Where the reports of the other commands are, NAME.json");
  parser.AddChoice("format", &options.format, {"text", "markdown"},
                   "How to print the table");
  if (!ParseOrPrintHelp(arguments, options.log, &parser)) return kExitDone;
  if (!std::filesystem::is_directory(folder)) {
    throw OptionError("report_path = " + folder + ", must be a folder");
  }
  const ResultTable table = Summarize(ReadReports(folder));
  PrintTable(options.log,
             options.format == "markdown" ? ToMarkdown(table) : ToText(table));
  return kExitDone;
}

}  // namespace krot::internal
