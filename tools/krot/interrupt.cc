#include "tools/krot/interrupt.h"

#include <csignal>

#include "tools/krot/command_error.h"

namespace krot {
namespace {

CancelFlag interrupted{false};
static_assert(CancelFlag::is_always_lock_free,
              "a signal handler may set lock-free atomics only");

void SetInterrupted(int) { interrupted.store(true); }

}  // namespace

const CancelFlag& CatchInterrupts() {
  struct sigaction action = {};
  action.sa_handler = &SetInterrupted;
  action.sa_flags = static_cast<int>(SA_RESETHAND) | SA_RESTART;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  return interrupted;
}

void ThrowIfInterrupted() {
  if (!IsCancelled(&interrupted)) return;
  throw CommandError(kExitInterrupted, "interrupted, nothing was written");
}

}  // namespace krot
