#pragma once

#include <stdexcept>
#include <string>

#include "krot/options/option_table.h"

namespace krot::internal {

// What `krot` returns; the table stands in docs/cli.md and in `krot help`.
enum ExitCode {
  kExitDone = 0,
  kExitOptions = 1,
  kExitModel = 2,
  kExitNothingToSolve = 3,
  kExitCertificateRefused = 4,
  kExitNotWritten = 5,
  kExitInternal = 6,
  kExitNoStart = 7,
  kExitGivenBack = 8,
  kExitWrong = 9,
  kExitUnreliable = 10,
  kExitInterrupted = 130,
  kExitClosedPipe = 141,
};

// Ends a command; what() is one sentence for the user.
class CommandError : public std::runtime_error {
 public:
  CommandError(ExitCode exit_code, const std::string& message)
      : std::runtime_error(message), exit_code_(exit_code) {}

  ExitCode exit_code() const { return exit_code_; }

 private:
  ExitCode exit_code_;
};

}  // namespace krot::internal
