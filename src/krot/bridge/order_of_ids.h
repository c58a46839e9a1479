#pragma once

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

namespace krot::internal {

// Indices of the records by their ids, which differ: the order in which a file
// happens to hold them makes no difference to a result.
template <typename Record>
std::vector<int32_t> OrderOfIds(const std::vector<Record>& records) {
  std::vector<int32_t> order(records.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int32_t a, int32_t b) {
    return records[a].id < records[b].id;
  });
  return order;
}

}  // namespace krot::internal
