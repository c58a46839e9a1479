#pragma once

#include "krot/linear/block_structure.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/proof/pull.h"

namespace krot {

// By how much p'x changes with points and frames' centres; 0 where they are
// fixed.
BlockVector CoefficientsOf(const KnownRotationProblem& problem,
                           const Pull& pull);

}  // namespace krot
