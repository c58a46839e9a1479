#pragma once

#include <cstdint>
#include <vector>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/bundle_adjustment.h"
#include "krot/linear/block_structure.h"

namespace krot::internal {

// The indices of the camera parameters that the options refine, in COLMAP's
// order. Each group is refined as a whole: focal length(s), principal point,
// others.
std::vector<int> RefinedParams(int camera_model,
                               const BundleAdjustmentOptions& options);

// The unknowns that move. Points aside, they are in blocks of three columns,
// which are numbered in the order frames, sensors, cameras, cap. Nothing that
// is fixed or takes part in no observation moves.
struct AdjustmentColumns {
  static constexpr int32_t kHeld = -1;
  // The blocks of theta and c, where x -> R exp([theta]x) (x - c).
  struct Pose {
    int32_t rotation = kHeld;
    int32_t center = kHeld;
  };
  // As many blocks as the refined parameters need. Columns that are left over
  // in the last block stand for nothing.
  struct Camera {
    int32_t first_block = kHeld;
    std::vector<int> params;

    int32_t num_blocks() const {
      return static_cast<int32_t>(params.size() + 2) / 3;
    }
  };

  AdjustmentColumns(const BundleAdjustmentOptions& options,
                    const AdjustmentBlocks& blocks);

  std::vector<char> point_moves;  // as AdjustmentBlocks::points
  std::vector<Pose> frames;       // as AdjustmentBlocks::frames
  std::vector<Pose> sensors;      // as sensors
  std::vector<Camera> cameras;
  int32_t cap = kHeld;  // one column
  int32_t num_blocks = 0;
  int64_t num_unknowns = 0;  // including points, without the cap

  void AddCap() { cap = num_blocks++; }
};

// Sets the unknowns of `*to` to those of `from`, moved by `step` along a
// direction of points and blocks. Unknowns that do not move keep their bits.
// Both are blocks of the same model.
void MoveAlong(const AdjustmentColumns& columns, const AdjustmentBlocks& from,
               const BlockVector& direction, double step, AdjustmentBlocks* to);

}  // namespace krot::internal
