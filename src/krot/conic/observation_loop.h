#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "krot/base/parallel_for.h"

namespace krot {

// Loops over observations in fixed chunks, and sums and minima over them in a
// fixed order: the same bits at any number of threads.
class ObservationLoop {
 public:
  ObservationLoop(int64_t count, int num_threads)
      : count_(count), num_threads_(num_threads) {}

  int64_t count() const { return count_; }
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

  int64_t count_;
  int num_threads_;
};

}  // namespace krot
