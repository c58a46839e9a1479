#pragma once

#include <memory>

#include "tools/benchmark/subproblem_solver.h"

namespace krot::internal {

// Polyhedron collapse [Donne et al. 2015; 8 of Zhang18], p = infinity. The
// points with a cost below gamma form a polyhedron, whose faces are the pieces
// +-v_k = gamma w of the residuals. From a point on its boundary the method
// moves inwards, away at equal rates from the faces on which the point lies, to
// the place on that line where the largest piece is smallest. gamma becomes the
// cost there, and the polyhedron shrinks. A quadratic equation says where two
// pieces are equal along the line.
std::unique_ptr<SubproblemSolver> MakePolyhedronCollapse();

}  // namespace krot::internal
