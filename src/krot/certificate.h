#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "krot/model.h"
#include "krot/solve.h"

namespace krot {

// Proofs as JSON (docs/formats.md): that no translations and points bring the
// largest error of a model below a bound (SolveResult::certificate), and that
// so many observations at least must go for a bound (OutlierResult::conflicts).
// They are judged by the model alone, by code that has nothing in common with
// the solvers and accounts for every rounding.

// What a certificate says about a model, judged from the two alone.
struct CertificateVerdict {
  bool is_accepted = false;
  std::string refusal;  // one sentence; empty if accepted
  // The rest is meaningful only if accepted.
  double lower_bound = 0;  // proved, pixels
  // Of the model as it is, true pixels; none where that puts an observation
  // behind its camera.
  std::optional<double> cost;
  std::optional<double> relative_gap;  // (cost - lower_bound) / cost
  // Of those whose positions it takes as fixed.
  int64_t num_fixed_images = 0;
  int64_t num_fixed_points = 0;
  // Those that it takes as known to a radius, where this model has the cameras.
  std::vector<SupportPosition> positions;
  double defect = 0;  // what rounding takes from the stated bound
  std::vector<SupportObservation> support;  // worst first
};

// What a file of conflicts proves about a model, judged from the two alone.
struct ConflictVerdict {
  bool is_accepted = false;
  std::string refusal;  // one sentence; empty if accepted
  // At least so many of the observations must go for all others to be within
  // max_error; meaningful only if accepted.
  int64_t num_conflicts = 0;
  int64_t num_observations = 0;  // of all conflicts
  double max_error = 0;          // true pixels
  // Whether the file has a bound for each observation: max_error is the
  // largest.
  bool has_own_bounds = false;
};

// Accepts if the file's digest of the model agrees and its multipliers prove
// the bound for the observations that it lists. Translations and points of the
// model do not enter into that, but for what the certificate takes as fixed.
// Requires a valid model. Throws ModelError, with the place, for what is no
// certificate. O(observations), and the check: far less than a solve.
CertificateVerdict VerifyCertificate(const Model& model,
                                     const std::string& json);

// Likewise, if no observation is in two conflicts and each of them proves an
// error above the bound.
ConflictVerdict VerifyConflicts(const Model& model, const std::string& json);

// The text of a file of either kind. Throws ModelError if it cannot be read.
std::string ReadCertificate(const std::filesystem::path& path);

// Writes it as a whole or not at all. Throws WriteError.
void WriteCertificate(const std::string& json,
                      const std::filesystem::path& path);

}  // namespace krot
