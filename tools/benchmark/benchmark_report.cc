#include "tools/benchmark/benchmark_report.h"

#include "krot/base/write_file.h"
#include "krot/version.h"

namespace krot::internal {
namespace {

using Json = nlohmann::ordered_json;

Json ToJson(const Machine& machine) {
  return {{"cpu", machine.cpu},
          {"cores", machine.cores},
          {"compiler", machine.compiler},
          {"flags", machine.flags},
          {"load", machine.load}};
}

std::string Print(const BenchmarkReport& report, const Machine& machine,
                  const BenchmarkOptions& options) {
  const bool is_markdown = options.format == "markdown";
  std::string text;
  for (const ResultTable& table : report.tables) {
    text += (is_markdown ? ToMarkdown(table) : ToText(table)) + "\n";
  }
  const std::string runs =
      options.repeats == 1 ? "Single runs"
                           : "Medians of " + std::to_string(options.repeats) +
                                 " interleaved runs";
  return text + runs + " on " + MachineLine(machine) + ".\n";
}

}  // namespace

void CheckReportPaths(const BenchmarkOptions& options) {
  for (const std::string& path : {options.report_path, options.plot_path}) {
    if (!path.empty()) CheckFileWritable(path);
  }
}

void PublishReport(const BenchmarkReport& report,
                   const BenchmarkOptions& options) {
  const Machine machine = ThisMachine();  // its load includes this benchmark
  PrintTable(options.log, Print(report, machine, options));
  if (!options.report_path.empty()) {
    Json tables = Json::array();
    for (const ResultTable& table : report.tables) {
      tables.push_back(ToJson(table));
    }
    const Json json = {
        {"version", KROT_VERSION},     {"command", report.command},
        {"machine", ToJson(machine)},  {"repeats", options.repeats},
        {"seed", options.random_seed}, {"tables", tables}};
    WriteFileAtomically(options.report_path, json.dump(2) + "\n");
  }
  if (!options.plot_path.empty() && report.plot) {
    WriteFileAtomically(options.plot_path, ToGnuplot(*report.plot));
  }
}

}  // namespace krot::internal
