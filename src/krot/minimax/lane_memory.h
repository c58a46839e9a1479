#pragma once

namespace krot::internal {

// Problems (1) side by side, one per lane of a vector. Plain memory, no Eigen:
// this header is shared with code compiled for other vector units.

inline constexpr int kLanes = 8;
using LaneDoubles = double[kLanes];

// A row of a residual of every lane's problem: a_1, b_1, a_2, b_2, c, d as in
// residual_kernel.h. A problem that has fewer residuals than the others has
// 0 / 1 here.
inline constexpr int kLaneRow = 12;
struct alignas(64) LaneRow {
  LaneDoubles entry[kLaneRow];
};

// The residual near x: value + gradient . d. What every iteration writes anew.
struct alignas(64) LanePiece {
  LaneDoubles value;
  LaneDoubles gradient[3];
  LaneDoubles depth_inverse;
  LaneDoubles multiplier;  // mu of local_model.h
};

// As many pieces as can bear a step.
inline constexpr int kCorners = 4;

}  // namespace krot::internal
