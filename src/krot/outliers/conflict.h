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

// Observations that no translations and points bring within a bound together,
// so that at least one of them must go [Sim, Hartley 2006].
struct Conflict {
  std::vector<int64_t> observations;  // of the built problem, ascending
  // Of the built problem, once there is one; its support is the observations.
  PixelCertificate proof;
  // Whether none of the observations can be spared: an estimate was found for
  // the others. Not asked of large ones.
  bool is_irreducible = false;
};

// A conflict among observations of `built` (ascending) that hang together, made
// irreducible by deletion: as long as what is left without one is refuted, too,
// it goes. None if they go together, or if that is not decided. It is refuted
// as far as the linear rows tell, not proved yet. Takes as many solves of the
// support as it has observations. Adds to `*work`.
std::optional<Conflict> FindConflict(const Model& model,
                                     const BuiltProblem& built,
                                     const ErrorBound& bound,
                                     const std::vector<int64_t>& observations,
                                     const Context& context, Work* work);

// Gives a conflict its proof, by which some observations may fall away; false
// if there is none. With strong lenses most of the time of a conflict. Adds to
// `*work`.
bool ProveConflict(const Model& model, const BuiltProblem& built,
                   const ErrorBound& bound, const Context& context,
                   Conflict* conflict, Work* work);

// Proved conflicts without a common observation among the given ones, as many
// as are found: every part of them that hangs together is asked for one, which
// is taken out, and so on with what remains, until `*work`, which it adds to,
// is used up. At least as many observations must go.
std::vector<Conflict> PackConflicts(const Model& model,
                                    const BuiltProblem& built,
                                    const ErrorBound& bound,
                                    const std::vector<int64_t>& observations,
                                    const Context& context, Work* work);

// Where each observation of a built problem stands among the model's track
// elements. O(track elements).
std::vector<uint64_t> ElementsOf(const Model& model, const BuiltProblem& built);

}  // namespace krot::internal
