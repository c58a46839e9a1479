// The command line, one argument a line, and an .ini file behind it.

#include <unistd.h>

#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/write_file.h"
#include "krot/options/command_options.h"
#include "tests/fuzz/fuzz.h"
#include "tools/krot/option_parser.h"

namespace krot::internal {
namespace {

std::string ProjectFile() {
  static const std::string file =
      (std::filesystem::temp_directory_path() /
       ("krot-fuzz-" + std::to_string(::getpid()) + ".ini"))
          .string();
  return file;
}

void Read(ByteSource source) {
  TolerantSolveOptions options;
  Context context;
  std::string input_path, report_path, project_path;
  OptionParser parser("solver", "fuzzed");
  parser.AddPath("input_path", &input_path, false, "a folder", "Input");
  parser.AddPath("project_path", &project_path, false, "an .ini file", "File");
  parser.AddOutputFile("report_path", &report_path, "Report");
  AddSolverOptions(&options, &context, &parser);

  const bool has_project = source.Byte() % 2 == 1;
  const std::string text = source.Rest("").bytes;
  const size_t cut = has_project ? text.find('\f') : std::string::npos;
  std::vector<std::string> arguments;
  std::istringstream lines(text.substr(0, cut));
  for (std::string line; std::getline(lines, line);) arguments.push_back(line);
  if (cut != std::string::npos) {
    WriteFile(ProjectFile(), text.substr(cut + 1));
    arguments.insert(arguments.end(), {"--project_path", ProjectFile()});
  }
  try {
    if (!parser.Parse(arguments)) {
      parser.Help();
      return;
    }
    ResolveSolverOptions(parser, &options.solve);
  } catch (const OptionError&) {
  }
}

}  // namespace
}  // namespace krot::internal

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  krot::internal::Read({data, size});
  return 0;
}
