#pragma once

#include <vector>

#include "krot/bridge/bridge.h"
#include "krot/math/norm.h"
#include "krot/model/model.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Takes every row so that its residual is at most `level` pixels wherever the
// true error is, over the rays of krot/camera/remainder_bound.h: at the pixel's
// own bearing, and wider by what the lens bends there, or for a pinhole by what
// rounding does. What is proved of all estimates with residuals within the
// level is then proved of all with true errors within it.
//
// Whether an observation has such a row; without, the row stays. Requires level
// > 0 and p = 1, 2 or infinity. Some hundreds of microseconds for each.
std::vector<char> TakeOuterRows(const Model& model, const BuiltProblem& built,
                                Norm norm, double level, int num_threads,
                                KnownRotationProblem* problem);

}  // namespace krot
