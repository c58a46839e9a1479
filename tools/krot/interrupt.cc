#include "tools/krot/interrupt.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <thread>

#include "krot/base/system.h"
#include "tools/krot/command_error.h"

namespace krot::internal {
namespace {

CancelFlag interrupted{false};
std::atomic<bool> is_ending{false};
std::atomic<bool> has_met_closed_pipe{false};
static_assert(CancelFlag::is_always_lock_free,
              "a signal handler may set lock-free atomics only");

// Made in advance: a signal handler allocates nothing.
std::array<char, 128> interrupt_sentence;
size_t sentence_length = 0;

void SetInterrupted() { interrupted.store(true); }

void End() {
  is_ending.store(true);
  WriteToStderr({interrupt_sentence.data(), sentence_length});
  std::_Exit(kExitInterrupted);
}

}  // namespace

void EndOnInterrupt(const std::string& who) {
  // The sentence begins on a new line, as a progress bar may stand on this one.
  const std::string text = (IsStderrTerminal() ? "\n" : "") + who +
                           ": interrupted, nothing was written\n";
  sentence_length = std::min(text.size(), interrupt_sentence.size());
  std::copy_n(text.begin(), sentence_length, interrupt_sentence.begin());
  OnEndRequest(&End, /*once=*/false);
}

void Interrupt() { interrupted.store(true); }

void OutliveClosedPipes() {
#ifdef SIGPIPE  // Windows has none
  std::signal(SIGPIPE, [](int) { has_met_closed_pipe.store(true); });
#endif
}

bool HasMetClosedPipe() { return has_met_closed_pipe.load(); }

const CancelFlag& DeferInterrupts() {
  OnEndRequest(&SetInterrupted, /*once=*/true);
  while (is_ending.load()) {  // another thread is ending the process
    std::this_thread::sleep_for(std::chrono::seconds(1));
  }
  return interrupted;
}

}  // namespace krot::internal
