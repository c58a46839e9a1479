// krot_benchmark COMMAND [options]: the table of commands, and the handling of
// exceptions.

#include <algorithm>
#include <iostream>
#include <new>
#include <string>
#include <vector>

#include "krot/base/write_file.h"
#include "krot/context.h"
#include "tools/benchmark/benchmark_command.h"
#include "tools/krot/command_error.h"

namespace krot::internal {
namespace {

struct Command {
  const char* name;
  const char* summary;
  int (*run)(const std::vector<std::string>& arguments);
};

constexpr Command kCommands[] = {
    {"triangulation", "one point at a time against its rivals [Fig. 4, Tab. 1]",
     &RunTriangulationBenchmark},
    {"blocks", "single sub-problems of models, fast against paper settings",
     &RunBlocksBenchmark},
    {"known_rotation", "the whole problem against its rivals [Tab. 2]",
     &RunKnownRotationBenchmark},
    {"sweep", "the cost of a sweep per observation, and its floor",
     &RunSweepBenchmark},
    {"scaling", "cost per observation as models grow", &RunScalingBenchmark},
    {"joint", "krot solver against colmap bundle_adjuster", &RunJointBenchmark},
    {"positioning", "a rival's positions from rotations and tracks",
     &RunPositioningBenchmark},
    {"summary", "what was asked, and what the reports of all these say",
     &RunSummaryBenchmark},
};

void PrintHelp() {
  std::cout << "krot_benchmark: KROT against its rivals\n\nUsage:\n"
               "  krot_benchmark COMMAND [options]\n"
               "  krot_benchmark COMMAND -h\n\nCommands:\n";
  for (const Command& command : kCommands) {
    const std::string name = command.name;
    std::cout << "  " << name << std::string(20 - name.size(), ' ')
              << command.summary << '\n';
  }
  std::cout << "\nExit codes are those of krot.\n";
}

int RunCommand(const std::vector<std::string>& arguments) {
  if (arguments.empty() || arguments.front() == "help" ||
      arguments.front() == "-h" || arguments.front() == "--help") {
    PrintHelp();
    return kExitDone;
  }
  for (const Command& command : kCommands) {
    if (arguments.front() == command.name) {
      return command.run({arguments.begin() + 1, arguments.end()});
    }
  }
  throw OptionError(arguments.front() +
                    " is no command (krot_benchmark help lists them)");
}

// Writes one line to stderr, even if the message has several.
int Fail(std::string message, int exit_code) {
  std::replace(message.begin(), message.end(), '\n', ' ');
  std::cerr << "krot_benchmark: " << message << std::endl;
  return exit_code;
}

int Main(const std::vector<std::string>& arguments) {
  try {
    const int exit_code = RunCommand(arguments);
    if (!std::cout.flush()) {
      return Fail("stdout cannot be written", kExitNotWritten);
    }
    return exit_code;
  } catch (const CommandError& error) {
    return Fail(error.what(), error.exit_code());
  } catch (const OptionError& error) {
    return Fail(error.what(), kExitOptions);
  } catch (const ModelError& error) {
    return Fail(error.what(), kExitModel);
  } catch (const WriteError& error) {
    return Fail(error.what(), kExitNotWritten);
  } catch (const std::bad_alloc&) {
    return Fail("out of memory", kExitInternal);
  } catch (const std::exception& error) {
    return Fail(std::string("internal error: ") + error.what(), kExitInternal);
  }
}

}  // namespace
}  // namespace krot::internal

int main(int argc, char** argv) {
  return krot::internal::Main({argv + std::min(argc, 1), argv + argc});
}
