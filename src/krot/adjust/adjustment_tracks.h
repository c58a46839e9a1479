#pragma once

#include <cstdint>
#include <vector>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/error_jacobians.h"
#include "krot/conic/block_structure.h"

namespace krot {

// The observations of every point, and the blocks of columns that they depend
// on.
class AdjustmentTracks {
 public:
  AdjustmentTracks(const ErrorJacobians& jacobians,
                   const AdjustmentBlocks& blocks, int32_t num_blocks);

  int64_t begin(int64_t k) const { return observation_begin_[k]; }
  int64_t end(int64_t k) const { return observation_begin_[k + 1]; }

  // Every block of the point once, ascending.
  const int32_t* blocks_begin(int64_t k) const {
    return structure_.frame_of.data() + structure_.point_begin[k];
  }
  const int32_t* blocks_end(int64_t k) const {
    return structure_.frame_of.data() + structure_.point_begin[k + 1];
  }
  // Where among these ErrorJacobians::blocks(i) stand.
  const int32_t* slots(int64_t i) const {
    return slots_.data() + slot_begin_[i];
  }

  // The same for a FrameSystem, with blocks for frames.
  const BlockStructure& structure() const { return structure_; }

 private:
  std::vector<int64_t> observation_begin_;  // num_points + 1
  BlockStructure structure_;
  std::vector<int64_t> slot_begin_;  // by observation
  std::vector<int32_t> slots_;
};

}  // namespace krot
