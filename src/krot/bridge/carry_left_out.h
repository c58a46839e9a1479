#pragma once

#include <vector>

#include "krot/bridge/bridge.h"
#include "krot/math/norm.h"
#include "krot/model.h"

namespace krot::internal {

// Points that took no part in the optimisation, in a model whose frames have
// moved: where the largest error of such a point, finite before, has risen
// above both its own old one and `level`, pixels, the point moves along with
// the image, of those of its track, that serves it best, and stays where it is
// if none does. What is fixed stays. A point of one observation keeps its error
// exactly to rounding. `errors_px` are PixelErrors of `before` in the norm.
// O(observations of such points).
void CarryLeftOutPoints(const Model& before,
                        const std::vector<double>& errors_px, Norm norm,
                        const BuiltProblem& built, const FixedParts& fixed,
                        double level, Model* after);

}  // namespace krot::internal
