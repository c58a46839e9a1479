#pragma once

#include "krot/base/context.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// SolveModel with all radii of options.problem.positions times the smallest
// factor, at least 1, at which the largest error can be at most
// options.inflate_positions_to, pixels. The lowest maximum falls as radii grow;
// the factor is bracketed by solves that end at most there and by bounds above
// it, which prove that no smaller factor will do. The result is that of the
// upper end; as with SolveModel, with the proof alone if even the largest
// factor tried is refuted. Some ten solves, each from the last one's estimate.
SolveModelResult SolveWithInflatedPositions(const Model& model,
                                            const SolveModelOptions& options,
                                            const Context& context);

}  // namespace krot::internal
