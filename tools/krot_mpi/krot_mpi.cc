// mpirun -n N krot_mpi solver [options]: krot solver by several processes.

#include <algorithm>
#include <chrono>
#include <functional>
#include <iostream>
#include <new>
#include <numeric>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/write_file.h"
#include "krot/context.h"
#include "krot/options/command_options.h"
#include "krot/report/text_table.h"
#include "krot/version.h"
#include "tools/krot/command_error.h"
#include "tools/krot/solve_command.h"
#include "tools/krot_mpi/mpi_ranks.h"
#include "tools/krot_mpi/shared_model.h"

namespace krot::internal {
namespace {

constexpr char kUsage[] =
    "krot_mpi: krot solver by several processes, on one machine or more\n"
    "\n"
    "Usage:\n"
    "  mpirun -n N krot_mpi solver [options]\n"
    "  krot_mpi solver -h\n"
    "  krot_mpi --version\n";

// A sentence on how much all ranks have sent to others.
std::string TrafficWords(MpiRanks* ranks) {
  const std::vector<int64_t> sent =
      ranks->Gather(std::vector<int64_t>{ranks->bytes_sent()});
  return "the ranks sent each other " +
         FormatBytes(std::accumulate(sent.begin(), sent.end(), int64_t{0}));
}

int RunSharedSolver(const std::vector<std::string>& arguments,
                    MpiRanks* ranks) {
  SolveCommand command;
  command.name = "solver";
  OptionParser parser("solver",
                      "what krot solver does, to the bit, by as many processes "
                      "as mpirun starts; each holds a share of the points",
                      "krot_mpi");
  AddModelPaths(&command.paths, &parser);
  AddCheckpointPath(&command.checkpoint, &parser);
  AddRotationsPath(&command.paths, &parser);
  parser.AddOutputFile("certificate_path", &command.certificate_path,
                       "Where the proof of the lower bound goes, as JSON");
  AddSolverOptions(&command.options, &command.context, &parser);
  AddLogLevel(&command.common.log, &parser);
  AddProjectPath(&command.common.project_path, &parser);
  if (!parser.Parse(arguments)) {
    if (ranks->IsFirst()) PrintTable(command.common.log, parser.Help());
    return kExitDone;
  }
  ResolveSolverOptions(parser, &command.options.solve);
  ResolveCheckpoint(parser, &command.checkpoint);
  command.context.ranks = ranks;
  if (command.options.max_error) {
    RequireOneRank(command.context, "Solver.max_error");
  }
  if (!ranks->IsFirst()) command.common.log.level = -1;

  SharedModel shared(command.paths, ranks);
  const bool has_checkpoint = !command.checkpoint.path.empty();
  command.read = [&](RunRecord* run) {
    return shared.Read(has_checkpoint, command.common.log, run);
  };
  command.take_share = [&](Model read) { return shared.Take(std::move(read)); };
  command.join = [&](Model* model, Model* solved, SolveSummary* summary) {
    const std::string words = TrafficWords(ranks);
    LogLine(command.common.log, 2, words);
    return shared.Join(model, solved, summary);
  };
  return RunSolveCommand(command);
}

int Run(const std::vector<std::string>& arguments, MpiRanks* ranks) {
  if (!arguments.empty() && arguments.front() == "solver") {
    return RunSharedSolver({arguments.begin() + 1, arguments.end()}, ranks);
  }
  if (!arguments.empty() && arguments.front() == "--version") {
    if (ranks->IsFirst()) std::cout << "krot_mpi " KROT_VERSION "\n";
    return kExitDone;
  }
  if (arguments.empty() || AskedHelp({arguments.front()})) {
    if (ranks->IsFirst()) std::cout << kUsage;
    return kExitDone;
  }
  throw OptionError(arguments.front() +
                    " is no command of krot_mpi: solver is");
}

// Writes one line to stderr and ends all ranks. If all ranks fail for the same
// reason, only the first one writes: the others wait, and are ended before.
[[noreturn]] void Fail(std::string message, int exit_code, MpiRanks* ranks) {
  constexpr auto kPrecedence = std::chrono::seconds(1);
  if (!ranks->IsFirst()) std::this_thread::sleep_for(kPrecedence);
  EndProgress();
  std::replace(message.begin(), message.end(), '\n', ' ');
  std::cerr << "krot_mpi: " +
                   (ranks->IsFirst()
                        ? ""
                        : "rank " + std::to_string(ranks->rank()) + ": ") +
                   message + "\n"
            << std::flush;
  ranks->Abort(exit_code);
}

int Main(const std::vector<std::string>& arguments, MpiRanks* ranks) {
  try {
    return Run(arguments, ranks);
  } catch (const CommandError& error) {
    Fail(error.what(), error.exit_code(), ranks);
  } catch (const OptionError& error) {
    Fail(error.what(), kExitOptions, ranks);
  } catch (const RanksError& error) {
    Fail(error.what(), kExitOptions, ranks);
  } catch (const CheckpointError& error) {
    Fail(error.what(), kExitOptions, ranks);
  } catch (const ModelError& error) {
    Fail(error.what(), kExitModel, ranks);
  } catch (const WriteError& error) {
    Fail(error.what(), kExitNotWritten, ranks);
  } catch (const std::bad_alloc&) {
    Fail("out of memory", kExitInternal, ranks);
  } catch (const std::exception& error) {
    Fail(std::string("internal error: ") + error.what(), kExitInternal, ranks);
  }
}

}  // namespace
}  // namespace krot::internal

int main(int argc, char** argv) {
  krot::internal::SilenceCeres();
  krot::internal::MpiRanks ranks(&argc, &argv);
  return krot::internal::Main({argv + std::min(argc, 1), argv + argc}, &ranks);
}
