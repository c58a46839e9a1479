#pragma once

#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// p = 1, 2 and infinity.
inline bool HasJointSolver(Norm norm) {
  return norm.p == 2 || norm.IsPolyhedral();
}

// SolveModel in the coordinates of the model, however far away: what that does
// in a frame amid the model.
SolveModelResult SolveInFrame(const Model& model,
                              const SolveModelOptions& options,
                              const Context& context);

}  // namespace krot::internal
