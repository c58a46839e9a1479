#pragma once

#include <cstdint>
#include <vector>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/bundle_adjustment.h"
#include "krot/linear/block_structure.h"

namespace krot {

// The free coordinates of a camera's parameters: focal length(s), principal
// point and others are refined or held still by the options, each as a whole.
// In COLMAP's order.
std::vector<int> RefinedParams(int camera_model,
                               const BundleAdjustmentOptions& options);

// Which unknowns move, the points aside: in blocks of three columns, by the
// index of their block, in the order frames, sensors, cameras, cap. What takes
// part in no observation is held still, and so is what is fixed.
struct AdjustmentColumns {
  static constexpr int32_t kHeld = -1;
  // Of x -> R (x - c): R turns to R exp([theta]x), c moves.
  struct Pose {
    int32_t rotation = kHeld;
    int32_t center = kHeld;
  };
  // As many blocks as the parameters that move need; the last one may have
  // columns to spare, which stand for nothing.
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
  int64_t num_unknowns = 0;  // with those of points; the cap is none

  void AddCap() { cap = num_blocks++; }
};

// Sets the unknowns of `*to` to those of `from`, moved along a direction of
// points and blocks. What is held still keeps its bits. Both are of one model.
void MoveAlong(const AdjustmentColumns& columns, const AdjustmentBlocks& from,
               const BlockVector& direction, double step, AdjustmentBlocks* to);

}  // namespace krot
