#pragma once

#include <memory>

#include "tools/benchmark/subproblem_solver.h"

namespace krot::internal {

// Polyhedron collapse [Donne et al. 2015; 8 of Zhang18], p = infinity: the
// points that cost less than gamma form a polyhedron, whose faces are the
// pieces +-v_k = gamma w of the residuals. From a point on its boundary one
// moves inwards, away at equal rates from the faces that it lies on, to where
// the largest piece is least along that line; gamma falls to the cost there and
// the polyhedron with it. Where two pieces are equal along the line is a
// quadratic equation.
std::unique_ptr<SubproblemSolver> MakePolyhedronCollapse();

}  // namespace krot::internal
