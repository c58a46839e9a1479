#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/conic/block_pattern.h"

namespace krot {

// L with L L' = A but for what is dropped: a block column keeps its largest
// blocks, half as many as A has there [Lin and More 1999], wherever they stand;
// as rows differ by decades, A's own places are not those that matter. In
// single precision: a preconditioner. Where such a factor does not exist, one
// of A + shift I does [Manteuffel 1980]; so A's blocks on the diagonal should
// be about the identity.
class IncompleteCholesky {
 public:
  // Of A's blocks, in the order of the pattern. False if no shift helps.
  bool Factorize(const BlockPattern& pattern,
                 const std::vector<Eigen::Matrix3d>& blocks);

  // (L L')^-1 rhs. Reads L twice.
  Eigen::VectorXf Solve(const Eigen::VectorXf& rhs) const;

  // Additions and multiplications that make it, at most.
  static double Operations(const BlockPattern& pattern);
  static int64_t MemoryBytes(const BlockPattern& pattern);

 private:
  struct Block {
    int32_t row;
    Eigen::Matrix3f value;
  };

  bool TryShift(const BlockPattern& pattern,
                const std::vector<Eigen::Matrix3d>& blocks, float shift);
  void AddToColumn(int32_t row, const Eigen::Matrix3f& value);
  void SubtractColumn(int32_t k);
  void KeepLargest(int64_t count);

  // By columns; on the diagonal, inverses.
  std::vector<int64_t> begin_;
  std::vector<Block> L_;
  float shift_ = 0;  // the last one that helped
  // While it is made, column by column: the column at hand; where a row is in
  // it (-1: nowhere); of the columns before, the first block that is not
  // above; and the columns whose first such block stands in a row.
  std::vector<Block> column_;
  std::vector<int32_t> place_;
  std::vector<int64_t> next_;
  std::vector<std::vector<int32_t>> waiting_;
};

}  // namespace krot
