#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/ranks.h"
#include "krot/conic/block_structure.h"

namespace krot {

// Which frames share points. Of the free frames, numbered among themselves:
// per frame those from it on that see one of its points, ascending, itself
// first.
using FramePattern = std::vector<std::vector<int32_t>>;

// O(sum of the squared lengths of tracks + frames^2 / 64), in scratch memory of
// 8 most_words bytes, or what a frame's row of bits takes.
FramePattern FindFramePattern(const BlockStructure& structure,
                              int64_t most_words = int64_t{1} << 23);

// Where ranks share the points, each with the pattern of its own: the pairs
// that share a point of any rank.
void UniteOverRanks(Ranks* ranks, FramePattern* pattern);

// The sparse Cholesky factor of a matrix with a 3x3 block for every pair of a
// pattern, in Eigen's fill-reducing order.
struct SparseFactorSize {
  int64_t numbers;
  double operations;  // additions and multiplications that make it
};

// By a symbolic factor of one number for every pair: next to nothing beside the
// factor itself.
SparseFactorSize FindSparseFactorSize(const FramePattern& pattern);

}  // namespace krot
