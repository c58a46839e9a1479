#include "tools/krot/interrupt.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>

#include "tools/krot/command_error.h"

namespace krot::internal {
namespace {

CancelFlag interrupted{false};
std::atomic<bool> is_ending{false};
static_assert(CancelFlag::is_always_lock_free,
              "a signal handler may set lock-free atomics only");

// Made in advance: a signal handler allocates nothing.
std::array<char, 128> sentence;
size_t sentence_length = 0;

void SetInterrupted(int) { interrupted.store(true); }

void End(int) {
  is_ending.store(true);
  if (::write(STDERR_FILENO, sentence.data(), sentence_length) < 0) {
    // Nobody listens.
  }
  ::_exit(kExitInterrupted);
}

void Handle(void (*handler)(int), int flags) {
  struct sigaction action = {};
  action.sa_handler = handler;
  action.sa_flags = flags;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

}  // namespace

void EndOnInterrupt(const std::string& who) {
  // A bar may stand on a terminal's line.
  const std::string text = (::isatty(STDERR_FILENO) == 1 ? "\n" : "") + who +
                           ": interrupted, nothing was written\n";
  sentence_length = std::min(text.size(), sentence.size());
  std::copy_n(text.begin(), sentence_length, sentence.begin());
  Handle(&End, 0);
}

void Interrupt() { interrupted.store(true); }

const CancelFlag& DeferInterrupts() {
  Handle(&SetInterrupted, static_cast<int>(SA_RESETHAND) | SA_RESTART);
  while (is_ending.load()) ::pause();  // another thread is ending the process
  return interrupted;
}

}  // namespace krot::internal
