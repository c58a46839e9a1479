#include "krot/adjust/adjustment_tracks.h"

#include <algorithm>

namespace krot {

AdjustmentTracks::AdjustmentTracks(const ErrorJacobians& jacobians,
                                   const AdjustmentBlocks& blocks,
                                   int32_t num_blocks)
    : observation_begin_(blocks.points.size() + 1, 0) {
  for (const AdjustmentObservation& observation : blocks.observations) {
    ++observation_begin_[observation.point + 1];
  }
  for (size_t k = 0; k < blocks.points.size(); ++k) {
    observation_begin_[k + 1] += observation_begin_[k];
  }
  structure_.point_begin.assign(1, 0);
  structure_.frame_is_fixed.assign(num_blocks, 0);
  std::vector<int32_t> seen;
  for (size_t k = 0; k < blocks.points.size(); ++k) {
    seen.clear();
    for (int64_t i = begin(k); i < end(k); ++i) {
      seen.insert(seen.end(), jacobians.blocks(i),
                  jacobians.blocks(i) + jacobians.num_blocks(i));
    }
    std::sort(seen.begin(), seen.end());
    seen.erase(std::unique(seen.begin(), seen.end()), seen.end());
    structure_.frame_of.insert(structure_.frame_of.end(), seen.begin(),
                               seen.end());
    structure_.point_begin.push_back(
        static_cast<int64_t>(structure_.frame_of.size()));
    for (int64_t i = begin(k); i < end(k); ++i) {
      slot_begin_.push_back(static_cast<int64_t>(slots_.size()));
      for (int n = 0; n < jacobians.num_blocks(i); ++n) {
        slots_.push_back(static_cast<int32_t>(
            std::lower_bound(seen.begin(), seen.end(), jacobians.blocks(i)[n]) -
            seen.begin()));
      }
    }
  }
}

}  // namespace krot
