#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "krot/context.h"

namespace krot::internal {

// Wall-clock seconds since construction. For reports only: no decision of a
// solver depends on it.
class Timer {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(Clock::now() - start_).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point start_ = Clock::now();
};

// One value in a vector, as a vector of bool does not hold plain values.
template <typename T>
struct Boxed {
  T value;
};

// Processes that solve one problem together. Each has all frames and a share of
// the points, with their observations; the shares of rank 0, 1, ..., one after
// another, are the whole problem in its order. All ranks take the same steps,
// and exchange numbers where one of the whole problem is needed. Numbers are
// combined in the order in which a single process combines them, so the result
// has the same bits at any number of ranks.
class Ranks {
 public:
  virtual ~Ranks() = default;

  virtual int rank() const = 0;   // in [0, count)
  virtual int count() const = 0;  // >= 1

  // Sends bytes[r] to each rank r, and returns what each rank r has sent to
  // this one. Every rank must call it.
  virtual std::vector<std::string> Exchange(std::vector<std::string> bytes) = 0;

  bool IsFirst() const { return rank() == 0; }

  // The same for plain values; T holds no pointer.
  template <typename T>
  std::vector<std::vector<T>> ExchangeValues(
      std::vector<std::vector<T>> values) {
    std::vector<std::string> bytes;
    for (std::vector<T>& to : values) {
      bytes.push_back(ToBytes(to));
      to = {};
    }
    std::vector<std::vector<T>> received;
    for (std::string& from : Exchange(std::move(bytes))) {
      received.push_back(FromBytes<T>(from));
      from = {};
    }
    return received;
  }

  // The values of all ranks in the order of the ranks: returned on the first
  // rank only, or on all.
  template <typename T>
  std::vector<T> GatherOnFirst(const std::vector<T>& values) {
    std::vector<std::vector<T>> to(count());
    to[0] = values;
    return Joined(ExchangeValues(std::move(to)));
  }
  template <typename T>
  std::vector<T> Gather(const std::vector<T>& values) {
    return Joined(ExchangeValues(std::vector<std::vector<T>>(count(), values)));
  }

  // Replaces the values on all ranks by those of one.
  template <typename T>
  void Broadcast(std::vector<T>* values, int from = 0) {
    std::vector<std::vector<T>> to(count());
    if (rank() == from) to.assign(count(), *values);
    *values = std::move(ExchangeValues(std::move(to))[from]);
  }
  template <typename T>
  void Broadcast(T* value, int from = 0) {
    std::vector<Boxed<T>> boxed = {{*value}};
    Broadcast(&boxed, from);
    *value = boxed[0].value;
  }

  // Replaces values[n] by combine(combine(a, b), c) ... of all ranks'
  // values[n]. All ranks must have equally many.
  template <typename T, typename Combine>
  void Reduce(const Combine& combine, std::vector<T>* values) {
    const std::vector<std::vector<T>> all =
        ExchangeValues(std::vector<std::vector<T>>(count(), *values));
    *values = all[0];
    for (int r = 1; r < count(); ++r) {
      for (size_t n = 0; n < values->size(); ++n) {
        (*values)[n] = combine((*values)[n], all[r][n]);
      }
    }
  }

  // The sum of `own` over the ranks before this one.
  int64_t SumBefore(int64_t own) {
    const std::vector<int64_t> all = Gather(std::vector<int64_t>{own});
    return std::accumulate(all.begin(), all.begin() + rank(), int64_t{0});
  }

  // Passes `value` from rank to rank, and each changes it in turn: a fold over
  // the points in their order. In the end all ranks have the last value.
  template <typename T, typename Change>
  void InTurn(const Change& change, T* value) {
    for (int r = 0; r < count(); ++r) {
      if (r == rank()) change(value);
      Broadcast(value, r);
    }
  }

 private:
  template <typename T>
  static std::string ToBytes(const std::vector<T>& values) {
    return {reinterpret_cast<const char*>(values.data()),
            values.size() * sizeof(T)};
  }
  template <typename T>
  static std::vector<T> FromBytes(const std::string& bytes) {
    std::vector<T> values(bytes.size() / sizeof(T));
    if (!bytes.empty()) {
      std::memcpy(static_cast<void*>(values.data()), bytes.data(),
                  bytes.size());
    }
    return values;
  }
  template <typename T>
  static std::vector<T> Joined(const std::vector<std::vector<T>>& parts) {
    std::vector<T> joined;
    for (const std::vector<T>& part : parts) {
      joined.insert(joined.end(), part.begin(), part.end());
    }
    return joined;
  }
};

// Thrown for what several processes cannot do together; what() is one sentence.
class RanksError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// The following reduce numbers of one process's share to numbers of the whole
// problem, if the processes of a context share its points; with one process
// they change nothing.

template <typename T, typename Combine>
void ReduceRanks(const Context& context, const Combine& combine,
                 std::vector<T>* values) {
  if (context.ranks != nullptr) context.ranks->Reduce(combine, values);
}

// The largest value, or the sum, over all processes' shares.
inline double MaxOfRanks(const Context& context, double own) {
  if (context.ranks == nullptr) return own;
  std::vector<double> value = {own};
  ReduceRanks(
      context, [](double a, double b) { return std::max(a, b); }, &value);
  return value[0];
}
inline int64_t SumOfRanks(const Context& context, int64_t own) {
  if (context.ranks == nullptr) return own;
  std::vector<int64_t> value = {own};
  ReduceRanks(
      context, [](int64_t a, int64_t b) { return a + b; }, &value);
  return value[0];
}
inline bool AllRanks(const Context& context, bool own) {
  return SumOfRanks(context, own ? 0 : 1) == 0;
}
inline bool AnyRank(const Context& context, bool own) {
  return SumOfRanks(context, own ? 1 : 0) > 0;
}

// Calls change(value) on every process in turn, in the order of their points.
template <typename T, typename Change>
void InTurnOfRanks(const Context& context, const Change& change,
                   std::vector<T>* value) {
  if (context.ranks == nullptr) return change(value);
  context.ranks->InTurn(change, value);
}

// Throws RanksError if several processes share the points.
inline void RequireOneRank(const Context& context, const std::string& what) {
  if (context.ranks == nullptr) return;
  throw RanksError(what + " is for one process: use krot solver");
}

// The context for work on this process's own share alone.
inline Context WithoutRanks(const Context& context) {
  Context alone = context;
  alone.ranks = nullptr;
  return alone;
}

}  // namespace krot::internal
