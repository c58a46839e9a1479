#pragma once

#include <cstdint>
#include <vector>

namespace krot {

// Which 3x3 blocks a symmetric matrix has, by its lower triangle: per block
// column the block rows, ascending, the diagonal's first.
struct BlockPattern {
  std::vector<int64_t> begin = {0};  // num_columns + 1
  std::vector<int32_t> row;          // per block

  int32_t num_columns() const { return static_cast<int32_t>(begin.size()) - 1; }
  int64_t num_blocks() const { return static_cast<int64_t>(row.size()); }
};

}  // namespace krot
