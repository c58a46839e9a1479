#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "krot/base/ranks.h"

namespace krot {

// Set from another thread or a signal handler; solvers look at it between
// steps and return what they have with the termination "interrupted".
using CancelFlag = std::atomic<bool>;

inline bool IsCancelled(const CancelFlag* cancel) {
  return cancel != nullptr && cancel->load(std::memory_order_relaxed);
}

// How work is done, as opposed to what is done. Every stage of a solve passes
// it on to the stages below. No result depends on it, unless the solve is
// interrupted. A stage reports its own iterations through the callback in its
// options.
struct Context {
  int num_threads = -1;                // -1: all
  const CancelFlag* cancel = nullptr;  // may be null
  // Receives a sentence about a choice that was made, and why; may be empty.
  std::function<void(const std::string&)> on_note = {};
  // Takes what a stage that may last does, as "looking for conflicts", and how
  // much of it is done; of 0: not known. From any thread; may be empty.
  std::function<void(const std::string& what, int64_t done, int64_t of)>
      on_stage = {};
  // The processes that share the points; null if this one has them all.
  Ranks* ranks = nullptr;

  bool IsCancelled() const { return krot::IsCancelled(cancel); }
  void Note(const std::string& sentence) const {
    if (on_note) on_note(sentence);
  }
  void Stage(const std::string& what, int64_t done = 0, int64_t of = 0) const {
    if (on_stage) on_stage(what, done, of);
  }

  // The same for a part of `whole`: stages begin with that.
  Context Within(const std::string& whole) const {
    Context part = *this;
    if (!on_stage) return part;
    part.on_stage = [whole, say = on_stage](const std::string& what,
                                            int64_t done, int64_t of) {
      say(whole + ": " + what, done, of);
    };
    return part;
  }

  // For work on this process's own share.
  Context Alone() const {
    Context alone = *this;
    alone.ranks = nullptr;
    return alone;
  }

  // The largest value and the sum over all processes' shares.
  double Max(double own) const {
    return Reduced(own, [](double a, double b) { return std::max(a, b); });
  }
  int64_t Sum(int64_t own) const {
    return Reduced(own, [](int64_t a, int64_t b) { return a + b; });
  }
  bool All(bool own) const { return Sum(own ? 0 : 1) == 0; }
  bool Any(bool own) const { return Sum(own ? 1 : 0) > 0; }
  template <typename T, typename Combine>
  void Reduce(const Combine& combine, std::vector<T>* values) const {
    if (ranks != nullptr) ranks->Reduce(combine, values);
  }
  // change(value), on every process in turn, in the order of their points.
  template <typename T, typename Change>
  void InTurn(const Change& change, std::vector<T>* value) const {
    if (ranks == nullptr) return change(value);
    ranks->InTurn(change, value);
  }
  // Throws RanksError where several processes share the points.
  void RequireAlone(const std::string& what) const {
    if (ranks == nullptr) return;
    throw RanksError(what + " is for one process: use krot solver");
  }

 private:
  template <typename T, typename Combine>
  T Reduced(T own, const Combine& combine) const {
    if (ranks == nullptr) return own;
    std::vector<T> value = {own};
    ranks->Reduce(combine, &value);
    return value[0];
  }
};

}  // namespace krot
