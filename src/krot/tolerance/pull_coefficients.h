#pragma once

#include "krot/conic/block_structure.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/proof/pull.h"

namespace krot {

// By how much p'x changes with the unknowns; 0 where they are fixed.
BlockVector CoefficientsOf(const KnownRotationProblem& problem,
                           const Pull& pull);

}  // namespace krot
