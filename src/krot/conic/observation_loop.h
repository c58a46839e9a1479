#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "krot/base/context.h"
#include "krot/base/parallel_for.h"

namespace krot {

// Loops over observations in fixed chunks, and sums and minima over them in a
// fixed order: the same bits at any number of threads, and of ranks that share
// the points: each loops over its own, and what is reduced is of the whole.
class ObservationLoop {
 public:
  ObservationLoop(int64_t count, int num_threads)
      : count_(count), num_threads_(num_threads), whole_count_(count) {}
  ObservationLoop(int64_t count, const Context& context)
      : ObservationLoop(count, context.num_threads) {
    ranks_ = context.ranks;
    whole_count_ = context.Sum(count);
    if (ranks_ != nullptr) first_ = ranks_->SumBefore(count);
  }

  int64_t count() const { return count_; }
  int64_t whole_count() const { return whole_count_; }
  int num_threads() const { return num_threads_; }

  template <typename Body>
  void ForEach(const Body& body) const {  // body(i)
    ParallelFor(count_, kChunk, num_threads_,
                [&](int64_t begin, int64_t end, int) {
                  for (int64_t i = begin; i < end; ++i) body(i);
                });
  }

  template <typename Term>
  double Sum(const Term& term) const {  // sum of term(i)
    return Reduce(0.0, term, [](double a, double b) { return a + b; });
  }

  template <typename Term>
  double Min(const Term& term) const {  // infinity if there are none
    return Reduce(std::numeric_limits<double>::infinity(), term,
                  [](double a, double b) { return std::min(a, b); });
  }

  // combine(... combine(start, term(0)) ..., term(count - 1)), chunk by chunk;
  // `start` is neutral.
  template <typename Value, typename Term, typename Combine>
  Value Reduce(const Value& start, const Term& term,
               const Combine& combine) const {
    if (ranks_ != nullptr) return ReduceInTurn(start, term, combine);
    std::vector<Value> parts(NumChunks(count_, kChunk), start);
    ParallelFor(count_, kChunk, num_threads_,
                [&](int64_t begin, int64_t end, int) {
                  Value value = start;
                  for (int64_t i = begin; i < end; ++i) {
                    value = combine(value, term(i));
                  }
                  parts[begin / kChunk] = value;
                });
    Value value = start;
    for (const Value& part : parts) value = combine(value, part);
    return value;
  }

 private:
  static constexpr int64_t kChunk = 4096;

  // A chunk of the whole that begins on one rank and ends on another is added
  // up on both in turn.
  template <typename Value, typename Term, typename Combine>
  Value ReduceInTurn(const Value& start, const Term& term,
                     const Combine& combine) const {
    const int64_t head = std::min(count_, (kChunk - first_ % kChunk) % kChunk);
    std::vector<Value> parts(NumChunks(count_ - head, kChunk), start);
    const auto add = [&](int64_t begin, int64_t end, Value value) {
      for (int64_t i = begin; i < end; ++i) value = combine(value, term(i));
      return value;
    };
    ParallelFor(count_ - head, kChunk, num_threads_,
                [&](int64_t begin, int64_t end, int) {
                  parts[begin / kChunk] = add(head + begin, head + end, start);
                });
    struct Sum {
      Value closed;  // of whole chunks
      Value open;    // of the one that is not yet
    };
    Sum sum{start, start};
    ranks_->InTurn(
        [&](Sum* so_far) {
          const auto close = [&](int64_t end) {
            if ((first_ + end) % kChunk != 0 && first_ + end != whole_count_) {
              return;
            }
            so_far->closed = combine(so_far->closed, so_far->open);
            so_far->open = start;
          };
          if (head > 0) {
            so_far->open = add(0, head, so_far->open);
            close(head);
          }
          for (size_t n = 0; n < parts.size(); ++n) {
            so_far->open = parts[n];
            close(
                std::min(count_, head + static_cast<int64_t>(n + 1) * kChunk));
          }
        },
        &sum);
    return sum.closed;
  }

  int64_t count_;
  int num_threads_;
  int64_t whole_count_;
  Ranks* ranks_ = nullptr;
  int64_t first_ = 0;  // in the whole
};

}  // namespace krot
