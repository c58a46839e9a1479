#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tools/benchmark/benchmark_options.h"
#include "tools/benchmark/log_plot.h"
#include "tools/benchmark/result_table.h"
#include "tools/krot/machine.h"

namespace krot::internal {

// The results of one benchmark.
struct BenchmarkReport {
  std::string command;
  std::vector<ResultTable> tables;
  std::optional<LogPlot> plot;
};

// Throws WriteError if a file that `options` asks for cannot be written. Call
// it before anything is measured.
void CheckReportPaths(const BenchmarkOptions& options);

// Prints the tables and the machine; writes the report and the plot if asked
// for.
void PublishReport(const BenchmarkReport& report,
                   const BenchmarkOptions& options);

}  // namespace krot::internal
