#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "krot/base/ranks.h"
#include "krot/context.h"

namespace krot::internal {

// A number of the whole problem, where the processes of a context share its
// points; in one process it is the number itself.

template <typename T, typename Combine>
void ReduceRanks(const Context& context, const Combine& combine,
                 std::vector<T>* values) {
  if (context.ranks != nullptr) context.ranks->Reduce(combine, values);
}

// The largest value and the sum over all processes' shares.
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

// change(value), on every process in turn, in the order of their points.
template <typename T, typename Change>
void InTurnOfRanks(const Context& context, const Change& change,
                   std::vector<T>* value) {
  if (context.ranks == nullptr) return change(value);
  context.ranks->InTurn(change, value);
}

// Throws RanksError where several processes share the points.
inline void RequireOneRank(const Context& context, const std::string& what) {
  if (context.ranks == nullptr) return;
  throw RanksError(what + " is for one process: use krot solver");
}

// For work on this process's own share.
inline Context WithoutRanks(const Context& context) {
  Context alone = context;
  alone.ranks = nullptr;
  return alone;
}

}  // namespace krot::internal
