#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tools/krot/log.h"
#include "tools/krot/option_parser.h"

namespace krot::internal {

// Options that every benchmark has.
struct BenchmarkOptions {
  std::vector<std::string> input_paths;  // models
  int repeats = 5;
  std::string format = "text";  // or "markdown"
  std::string report_path;      // JSON; empty: none
  std::string plot_path;        // for gnuplot; empty: none
  uint64_t random_seed = 0;
  LogOptions log;
  std::string project_path;
};

void AddBenchmarkOptions(BenchmarkOptions* options, OptionParser* parser);

OptionParser MakeBenchmarkParser(const std::string& command,
                                 const std::string& summary);

}  // namespace krot::internal
