#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/bridge/pixel_certificate.h"
#include "krot/math/norm.h"
#include "krot/model.h"

namespace krot::internal {

// What observations are asked to stay within.
struct ErrorBound {
  Norm norm;             // p = 1, 2 or infinity
  double max_error = 0;  // true pixels; > 0
};

// What decisions and their proofs take: iterations of the joint solver times
// observations, a few microseconds each. It is counted rather than timed, so
// that what ends at a limit ends at the same place every time.
struct Work {
  int64_t done = 0;
  int64_t limit = std::numeric_limits<int64_t>::max();

  bool IsUsedUp() const { return done >= limit; }
};

// Whether some observations go together: either an estimate whose true errors
// are all within the bound, or some of them that do not, as far as the linear
// rows at `estimate` tell. Neither where the optimum all but is the bound.
struct Decision {
  bool is_feasible = false;
  bool is_refuted = false;
  Estimate estimate;
  std::vector<int64_t> support;  // if refuted; ascending
};

// Decides on all observations of `part`, which hang together, from its start,
// or one from nothing where a depth is not positive, in a few rounds: solves
// the linear rows, and takes them anew at the solution. Undecided after a few
// hundred iterations. Adds to `*work`.
Decision Decide(const Model& model, const BuiltProblem& part,
                const ErrorBound& bound, const Context& context, Work* work);

// The proof in true pixels of what Decide found; none if the lenses take too
// much of it. It is checked. Adds to `*work`.
std::optional<PixelCertificate> ProveRefutation(
    const Model& model, const BuiltProblem& part, const ErrorBound& bound,
    const Decision& refuted, const Context& context, Work* work);

}  // namespace krot::internal
