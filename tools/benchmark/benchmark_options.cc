#include "tools/benchmark/benchmark_options.h"

namespace krot::internal {

void AddBenchmarkOptions(BenchmarkOptions* options, OptionParser* parser) {
  parser->Add({"input_path", "A model to measure on; may be given repeatedly",
               "a folder", "", false,
               [options](const std::string& text) {
                 options->input_paths.push_back(text);
                 return !text.empty();
               },
               /*repeatable=*/true});
  parser->AddInteger("repeats", &options->repeats, AtLeast(1),
                     "Rounds in which every competitor runs once; medians are "
                     "printed");
  parser->AddChoice("format", &options->format, {"text", "markdown"},
                    "How to print the tables");
  parser->AddOutputFile("report_path", &options->report_path,
                        "Where the same goes as JSON");
  parser->AddOutputFile("plot_path", &options->plot_path,
                        "Where the plot goes, as a script with which gnuplot "
                        "prints an SVG");
  parser->Add({"random_seed", "What random instances are made from",
               "an integer >= 0", std::to_string(options->random_seed), false,
               [options](const std::string& text) {
                 return ParseInteger(text, &options->random_seed);
               }});
  parser->AddInteger("log_level", &options->log.level, Between(0, 2),
                     "What to say on stderr: 0 errors only, 1 progress, 2 "
                     "details");
  parser->AddPath("project_path", &options->project_path, false, "an .ini file",
                  "Options in COLMAP's manner; explicit flags win");
}

OptionParser MakeBenchmarkParser(const std::string& command,
                                 const std::string& summary) {
  return {command, summary, "krot_benchmark"};
}

}  // namespace krot::internal
