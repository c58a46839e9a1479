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

// O(sum of the squared lengths of tracks), and the pattern's size.
FramePattern FindFramePattern(const BlockStructure& structure);

// Where ranks share the points, each with the pattern of its own: of all pairs
// of frames, those that share a point of any rank; and what they are.
double ShareOfPairs(const FramePattern& pattern, Ranks* ranks);
void UniteOverRanks(Ranks* ranks, FramePattern* pattern);

}  // namespace krot
