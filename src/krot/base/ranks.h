#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace krot {

// Processes that solve one problem together. Each has all frames and a share
// of the points, with their observations: the ranks' shares one after another
// are the whole, in its order. All take the same steps in the same order, and
// meet where a number is of the whole. Largest values are exact; whatever else
// is reduced is combined in the order that one process takes, so the result has
// the same bits at any number of ranks.
class Ranks {
 public:
  virtual ~Ranks() = default;

  virtual int rank() const = 0;   // in [0, count)
  virtual int count() const = 0;  // >= 1

  // Sends bytes[r] to every rank r, and returns what every rank r has sent
  // here. Every rank must call it.
  virtual std::vector<std::string> Exchange(std::vector<std::string> bytes) = 0;

  bool IsFirst() const { return rank() == 0; }

  // The same for plain values: T holds no pointer.
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

  // The values of all ranks, one rank's after another's; only on the first, or
  // on all.
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

  // Replaces the values by those of one rank.
  template <typename T>
  void Broadcast(std::vector<T>* values, int from = 0) {
    std::vector<std::vector<T>> to(count());
    if (rank() == from) to.assign(count(), *values);
    *values = std::move(ExchangeValues(std::move(to))[from]);
  }
  template <typename T>
  void Broadcast(T* value, int from = 0) {
    struct Boxed {  // vectors of bool are no plain values
      T value;
    };
    std::vector<Boxed> boxed = {{*value}};
    Broadcast(&boxed, from);
    *value = boxed[0].value;
  }

  // combine(combine(a, b), c) of the ranks' values, one by one; all have as
  // many.
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

  // What the ranks before this one have, together.
  int64_t SumBefore(int64_t own) {
    const std::vector<int64_t> all = Gather(std::vector<int64_t>{own});
    return std::accumulate(all.begin(), all.begin() + rank(), int64_t{0});
  }

  // Hands `value` on from rank to rank, each of which changes it in turn: a
  // fold over the points in their order. All have the last one.
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

// What several processes cannot do together; one sentence.
class RanksError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace krot
