#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>

namespace krot {

// What all functions of the library share: how they work, and how they fail.
//
// - misuse: std::invalid_argument, "name = value, must be ..."
// - a bad file or model: ModelError
// - an output that cannot be written: WriteError
// - a numerical outcome: an enum in the result, by default "not run"

// Set from another thread or a signal handler. Solvers look at it between steps
// and return what they have, with the termination "interrupted".
using CancelFlag = std::atomic<bool>;

inline bool IsCancelled(const CancelFlag* cancel) {
  return cancel != nullptr && cancel->load(std::memory_order_relaxed);
}

namespace internal {
class Ranks;
}

// How work is done, as opposed to what is done. Unless the work is cancelled,
// no result depends on it: results have the same bits at any number of threads.
struct Context {
  int num_threads = -1;                // -1: all processors
  const CancelFlag* cancel = nullptr;  // may be null
  // Receives a sentence about a choice that was made and why; may be empty.
  std::function<void(const std::string&)> on_note = {};
  // Receives what a long stage is doing, such as "looking for conflicts", and
  // how much of it is done; `of` is 0 if the total is not known. Called from
  // any thread; may be empty.
  std::function<void(const std::string& what, int64_t done, int64_t of)>
      on_stage = {};
  // The processes that share the points; used by krot_mpi alone. Null if this
  // process has them all.
  internal::Ranks* ranks = nullptr;

  bool IsCancelled() const { return krot::IsCancelled(cancel); }
  void Note(const std::string& sentence) const {
    if (on_note) on_note(sentence);
  }
  void Stage(const std::string& what, int64_t done = 0, int64_t of = 0) const {
    if (on_stage) on_stage(what, done, of);
  }

  // A copy for a part of the work `whole`, whose name precedes those of the
  // stages.
  Context Within(const std::string& whole) const {
    Context part = *this;
    if (!on_stage) return part;
    part.on_stage = [whole, say = on_stage](const std::string& what,
                                            int64_t done, int64_t of) {
      say(whole + ": " + what, done, of);
    };
    return part;
  }
};

// A file or model that cannot be read or used. what() is one sentence: the
// file, the place in it (byte offset or line), what was found and what was
// expected.
class ModelError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// A file or folder that cannot be written; what() is one sentence. What stood
// there before has not changed.
class WriteError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace krot
