#pragma once

#include <Eigen/Core>

#include "krot/conic/block_structure.h"
#include "krot/minimax/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// What the cone programmes share of a problem.

// The frame with the most observations stays put: the translation gauge.
BlockStructure StructureOf(const KnownRotationProblem& problem);

// T: (top; v) with ||v||_p <= top into the cone of dimension 3, for p = 2, or
// 4, for p = 1 and infinity.
template <int kDim>
Eigen::Matrix<double, kDim, 3> ConeMap(Norm norm) {
  Eigen::Matrix<double, kDim, 3> T;
  if constexpr (kDim == 3) {
    T.setIdentity();
  } else if (norm.p == 1) {  // top +- v1 +- v2
    T << 1, 1, 1, 1, 1, -1, 1, -1, 1, 1, -1, -1;
  } else {  // top +- v1, top +- v2
    T << 1, 1, 0, 1, -1, 0, 1, 0, 1, 1, 0, -1;
  }
  return T;
}

}  // namespace krot
