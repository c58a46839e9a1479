#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

namespace krot::internal {

// Union-find with path halving over 0, 1, ..., count - 1. At first each member
// is a set of its own. The root of a set is its smallest member.
class DisjointSets {
 public:
  explicit DisjointSets(int64_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  int64_t Find(int64_t member) {
    while (parent_[member] != member) {
      parent_[member] = parent_[parent_[member]];
      member = parent_[member];
    }
    return member;
  }

  void Unite(int64_t a, int64_t b) {
    const auto [low, high] = std::minmax({Find(a), Find(b)});
    parent_[high] = low;
  }

 private:
  std::vector<int64_t> parent_;
};

}  // namespace krot::internal
