#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/bridge/pixel_certificate.h"
#include "krot/model.h"
#include "krot/outliers/decision.h"

namespace krot::internal {

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

}  // namespace krot::internal
