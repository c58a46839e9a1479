// krot COMMAND [options]: the command table, and which exit code and sentence
// an exception becomes.

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <new>
#include <string>
#include <system_error>
#include <vector>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/checkpoint.h"
#include "krot/base/system.h"
#include "krot/base/write_file.h"
#include "krot/context.h"
#include "krot/options/option_table.h"
#include "krot/version.h"
#include "tools/krot/command.h"
#include "tools/krot/command_error.h"
#include "tools/krot/help_pages.h"
#include "tools/krot/interrupt.h"
#include "tools/krot/log.h"
#include "tools/krot/run_log.h"

namespace krot::internal {
namespace {

struct Command {
  const char* name;
  const char* summary;
  int (*run)(const std::vector<std::string>& arguments);
};

int RunHelp(const std::vector<std::string>& arguments);

constexpr Command kCommands[] = {
    {"solver", "lower the largest reprojection error of a model", &RunSolver},
    {"point_triangulator", "re-estimate the points, frames fixed",
     &RunPointTriangulator},
    {"bundle_adjuster", "least squares, below a cap if you want",
     &RunBundleAdjuster},
    {"model_checker", "say what is wrong with a model, and cure it",
     &RunModelChecker},
    {"outlier_filter", "remove the observations that do not fit",
     &RunOutlierFilter},
    {"tolerance_analyzer", "show everywhere that cameras and points may be",
     &RunToleranceAnalyzer},
    {"model_analyzer", "show what a model's errors look like",
     &RunModelAnalyzer},
    {"model_comparer", "show how two models differ", &RunModelComparer},
    {"certificate_checker",
     "re-check the proof of a lower bound, or of conflicts",
     &RunCertificateChecker},
    {"model_synthesizer", "make a model with ground truth",
     &RunModelSynthesizer},
    {"help", "print this text, or that of a command", &RunHelp},
};

constexpr char kHelpHead[] =
    "krot: the known rotation problem for COLMAP models\n"
    "\n"
    "Usage:\n"
    "  krot COMMAND [options]\n"
    "  krot COMMAND -h\n"
    "  krot --version\n"
    "\n"
    "Commands:\n";

constexpr char kExitCodes[] =
    "    0  done\n"
    "    1  the options are wrong\n"
    "    2  the model cannot be read or is inconsistent\n"
    "    3  nothing to solve\n"
    "    4  a certificate was refused\n"
    "    5  the output cannot be written\n"
    "    6  out of memory or threads, or an error in KROT itself\n"
    "    7  no estimate below the error that a start may have\n"
    "    8  no better estimate: the model is written as it was read\n"
    "    9  something is wrong with the model, and --fail_on wrong asked\n"
    "   10  positions from nothing that are not to be relied on: the model is "
    "written\n"
    "  130  interrupted by SIGINT or SIGTERM\n"
    "  141  done, but the reader of stdout left\n";

const Command* FindCommand(const std::string& name) {
  const auto it = std::find_if(
      std::begin(kCommands), std::end(kCommands),
      [&](const Command& command) { return name == command.name; });
  return it == std::end(kCommands) ? nullptr : &*it;
}

const Command& RequireCommand(const std::string& name) {
  const Command* command = FindCommand(name);
  if (command != nullptr) return *command;
  std::vector<std::string> names;
  for (const Command& known : kCommands) names.push_back(known.name);
  const std::string nearest = NearestName(name, names);
  throw OptionError(name + " is no command" +
                    (nearest.empty() ? " (krot help lists them)"
                                     : "; did you mean " + nearest + "?"));
}

std::vector<CommandSummary> Summaries() {
  std::vector<CommandSummary> summaries;
  for (const Command& command : kCommands) {
    summaries.push_back({command.name, command.summary});
  }
  return summaries;
}

void PrintHelpOfEach(const std::string& format) {
  for (const Command& command : kCommands) {
    if (command.run != &RunHelp) command.run({"--help=" + format});
  }
}

void PrintHelp(HelpFormat format) {
  const std::vector<CommandSummary> commands = Summaries();
  switch (format) {
    case HelpFormat::kText:
      std::cout << kHelpHead;
      for (const CommandSummary& command : commands) {
        std::cout << "  " << command.name
                  << std::string(20 - command.name.size(), ' ')
                  << command.summary << '\n';
      }
      std::cout << "\nExit codes:\n" << kExitCodes;
      break;
    case HelpFormat::kMan:
      std::cout << ManPage(commands, kExitCodes);
      break;
    case HelpFormat::kBash:
      std::cout << BashHead(commands);
      PrintHelpOfEach("bash");
      std::cout << BashTail();
      break;
    case HelpFormat::kZsh:
      std::cout << ZshHead(commands);
      PrintHelpOfEach("zsh");
      std::cout << ZshTail();
      break;
  }
}

int RunHelp(const std::vector<std::string>& arguments) {
  if (!arguments.empty() && arguments.front().rfind('-', 0) != 0) {
    return RequireCommand(arguments.front()).run({"--help"});
  }
  PrintHelp(AskedHelp(arguments).value_or(HelpFormat::kText));
  return kExitDone;
}

int RunCommand(const std::vector<std::string>& arguments) {
  if (arguments.empty()) return RunHelp({});
  const std::string& name = arguments.front();
  if (name == "--version") {
    std::cout << "krot " KROT_VERSION "\n";
    return kExitDone;
  }
  if (AskedHelp({name})) return RunHelp({name});
  return RequireCommand(name).run({arguments.begin() + 1, arguments.end()});
}

// Prints the message as one line on stderr, whatever it holds.
int Fail(const std::string& who, std::string message, int exit_code) {
  std::replace(message.begin(), message.end(), '\n', ' ');
  EndProgress();
  LogLine({}, 0, who + ": " + message);
  return exit_code;
}

int RunOrFail(const std::string& who,
              const std::vector<std::string>& arguments) {
  try {
    const int exit_code = RunCommand(arguments);
    if (!std::cout.flush()) {
      if (HasMetClosedPipe())
        return exit_code == kExitDone ? kExitClosedPipe : exit_code;
      return Fail(who, "stdout cannot be written", kExitNotWritten);
    }
    return exit_code;
  } catch (const CommandError& error) {
    return Fail(who, error.what(), error.exit_code());
  } catch (const OptionError& error) {
    return Fail(who, error.what(), kExitOptions);
  } catch (const NoCeresError& error) {
    return Fail(who, error.what(), kExitOptions);
  } catch (const CheckpointError& error) {
    return Fail(who, error.what(), kExitOptions);
  } catch (const ModelError& error) {
    return Fail(who, error.what(), kExitModel);
  } catch (const WriteError& error) {
    return Fail(who, error.what(), kExitNotWritten);
  } catch (const std::bad_alloc&) {
    return Fail(who, "out of memory", kExitInternal);
  } catch (const std::system_error& error) {
    return Fail(who, "refused by the system: " + error.code().message(),
                kExitInternal);
  } catch (const std::exception& error) {
    return Fail(who, std::string("internal error: ") + error.what(),
                kExitInternal);
  } catch (...) {
    return Fail(who, "internal error", kExitInternal);
  }
}

std::string out_of_memory;  // the sentence, made while there is memory
std::atomic<bool> has_memory_ended{false};

[[noreturn]] void OnMemoryEnd() {
  has_memory_ended = true;
  throw std::bad_alloc();
}

// Libraries whose destructors allocate (nlohmann/json, Ceres) terminate the
// process when memory ends. Then at least the sentence and the exit code are
// the usual ones. It may be unknown here what was thrown.
[[noreturn]] void EndWithoutUnwinding() {
  try {
    if (const std::exception_ptr error = std::current_exception()) {
      std::rethrow_exception(error);
    }
    if (has_memory_ended) throw std::bad_alloc();
  } catch (const std::bad_alloc&) {
    if (!WriteToStderr(out_of_memory)) std::abort();
    std::_Exit(kExitInternal);
  } catch (...) {
    std::abort();
  }
  std::abort();
}

int Main(const std::vector<std::string>& arguments) {
  const std::string who =
      arguments.empty() || FindCommand(arguments.front()) == nullptr
          ? "krot"
          : "krot " + arguments.front();
  EndOnInterrupt(who);
  OutliveClosedPipes();
  out_of_memory = who + ": out of memory\n";
  std::set_new_handler(&OnMemoryEnd);
  std::set_terminate(&EndWithoutUnwinding);
  const int exit_code = RunOrFail(who, arguments);
  EndRunLog(exit_code);
  return exit_code;
}

}  // namespace
}  // namespace krot::internal

int main(int argc, char** argv) try {
  krot::internal::SilenceCeres();
  return krot::internal::EndIfMemoryIsLimited(
      krot::internal::Main(krot::internal::ProgramArguments(argc, argv)));
} catch (const std::bad_alloc&) {
  return krot::internal::EndIfMemoryIsLimited(krot::internal::Fail(
      "krot", "out of memory", krot::internal::kExitInternal));
}
