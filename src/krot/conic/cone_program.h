#pragma once

#include <optional>

#include "krot/conic/block_structure.h"
#include "krot/problem/cost.h"

namespace krot {

// h'x, to be minimised along e'x = const.
struct LinearObjective {
  BlockVector h;
  std::optional<BlockVector> e;  // none: nothing of the kind is kept
};

// The programmes that the interior point solves: minimise a scalar g subject to
// (top_i, v_i) in the cone ||v|| <= top for every observation, where
//
//   cost:         top = g w              g is gamma, a bound on all residuals
//   feasibility:  top = b (w + u (g - 1))  g < 1 makes every residual < b
//   linear:       top = b w              g = h'x
//
// with w the depth and u a unit of depth. The first is homogeneous in the
// unknowns where no baseline sets a scale; the second needs no positive depth
// to start.
struct ConeProgram {
  enum class Kind { kCost, kFeasibility, kLinear };
  Kind kind = Kind::kCost;
  double bound = 0;       // b, pixels; not of the cost programme
  double unit_depth = 1;  // u, scene units; 0 of the linear programme
  const LinearObjective* linear = nullptr;  // of the linear programme

  bool IsCost() const { return kind == Kind::kCost; }
  bool IsLinear() const { return kind == Kind::kLinear; }
  double Top(double depth, double g) const {
    return IsCost() ? g * depth : bound * (depth + unit_depth * (g - 1));
  }
  double TopPerDepth(double g) const { return IsCost() ? g : bound; }
  double TopPerScalar(double depth) const {
    return IsCost() ? depth : bound * unit_depth;
  }
};

}  // namespace krot
