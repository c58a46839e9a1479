#pragma once

#include <cstdint>
#include <string>

#include "krot/bridge/conflict_file.h"
#include "krot/model/model.h"

namespace krot {

// What a file of conflicts proves about a model, judged from the two alone.
struct ConflictVerdict {
  bool is_accepted = false;
  std::string refusal;  // one sentence; empty if accepted
  // At least so many of the observations must go for all others to be within
  // max_error; meaningful only if accepted.
  int64_t num_conflicts = 0;
  int64_t num_observations = 0;  // of all conflicts
  double max_error = 0;          // true pixels
};

// Accepts if the digest of the model agrees, no observation is in two
// conflicts, and CheckPixelCertificate accepts every one of them with a bound
// above max_error. Translations and points do not enter, as with
// VerifyCertificateFile. Requires a valid model; throws what BuildProblem does.
ConflictVerdict VerifyConflictFile(const Model& model,
                                   const ConflictFile& file);

}  // namespace krot
