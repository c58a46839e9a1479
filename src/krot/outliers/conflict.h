#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/math/norm.h"
#include "krot/model.h"

namespace krot::internal {

// What the errors of observations are asked to stay within.
struct ErrorBound {
  Norm norm;             // p = 1, 2 or infinity
  double max_error = 0;  // true pixels; > 0
};

// The work of decisions and proofs, in iterations of the joint solver times
// observations, a few microseconds each. It is counted rather than timed, so
// that a search that ends at its limit ends at the same place every time.
struct Work {
  int64_t done = 0;
  int64_t limit = std::numeric_limits<int64_t>::max();

  bool IsUsedUp() const { return done >= limit; }
};

// Whether some observations can be satisfied together: either an estimate at
// which all their true errors are within the bound, or a support, some of them
// that no estimate brings within it, as far as the linear rows tell. Neither
// where the optimum is too near to the bound.
struct Decision {
  bool is_feasible = false;
  bool is_refuted = false;
  Estimate estimate;
  std::vector<int64_t> support;  // if refuted; ascending
};

// Decides on all observations of `part`, which must be connected, in a few
// rounds that solve the linear rows and take them anew at the solution. Starts
// from part.start or, where a depth there is not positive, from nothing. Gives
// up after a few hundred iterations. Adds to `*work`.
Decision Decide(const Model& model, const BuiltProblem& part,
                const ErrorBound& bound, const Context& context, Work* work);

// Proves in true pixels what Decide refuted; the proof is checked. None if lens
// distortion takes up too much of the margin. Adds to `*work`.
std::optional<PixelCertificate> ProveRefutation(
    const Model& model, const BuiltProblem& part, const ErrorBound& bound,
    const Decision& refuted, const Context& context, Work* work);

// Observations that no translations and points bring within a bound together,
// so that at least one of them must go [Sim, Hartley 2006].
struct Conflict {
  std::vector<int64_t> observations;  // of the built problem, ascending
  // In the built problem's numbers; empty before ProveConflict. Its support is
  // `observations`.
  PixelCertificate proof;
  // Whether none of the observations can be spared: for each, an estimate was
  // found that satisfies all others. Large conflicts are not tested.
  bool is_irreducible = false;
};

// Finds a conflict among connected observations of `built` (ascending) and
// makes it irreducible by deletion: an observation goes if the others are still
// refuted. None if they can be satisfied together, or if nothing is decided.
// The conflict is refuted as far as the linear rows tell, not proved yet. Takes
// as many solves of the support as it has observations. Adds to `*work`.
std::optional<Conflict> FindConflict(const Model& model,
                                     const BuiltProblem& built,
                                     const ErrorBound& bound,
                                     const std::vector<int64_t>& observations,
                                     const Context& context, Work* work);

// Proves a conflict; observations that the proof does without are dropped.
// False if there is no proof. With strong lenses this takes most of the time of
// a conflict. Adds to `*work`.
bool ProveConflict(const Model& model, const BuiltProblem& built,
                   const ErrorBound& bound, const Context& context,
                   Conflict* conflict, Work* work);

// Finds proved conflicts among the given observations, no two of which share an
// observation, so that at least as many observations must go. Every connected
// part is searched; the conflict found is taken out, and what remains is
// searched again, until `*work`, which this adds to, is used up.
std::vector<Conflict> PackConflicts(const Model& model,
                                    const BuiltProblem& built,
                                    const ErrorBound& bound,
                                    const std::vector<int64_t>& observations,
                                    const Context& context, Work* work);

// For each observation of a built problem its index among the model's track
// elements. O(track elements).
std::vector<uint64_t> ElementsOf(const Model& model, const BuiltProblem& built);

}  // namespace krot::internal
