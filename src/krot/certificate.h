#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "krot/model.h"
#include "krot/solve.h"

namespace krot {

// Proofs as JSON (docs/formats.md). A certificate (SolveResult::certificate)
// proves that no translations and points bring the largest error of a model
// below a bound. A file of conflicts (OutlierResult::conflicts) proves how many
// observations must go at least before all others are within a bound. The
// checker needs nothing but the model and the file. It shares no code with the
// solvers and accounts for every rounding.

// What a certificate says about a model, judged from the two alone.
struct CertificateVerdict {
  bool is_accepted = false;
  std::string refusal;  // one sentence; empty if accepted
  // The rest is meaningful only if accepted.
  double lower_bound = 0;  // proved, pixels
  // The largest true error of the usable observations, pixels, with the model's
  // own translations and points; points behind a camera are re-triangulated.
  // None if one of them still does not project.
  std::optional<double> cost;
  std::optional<double> relative_gap;  // (cost - lower_bound) / cost
  // Images and points in the support whose positions the certificate takes as
  // fixed.
  int64_t num_fixed_images = 0;
  int64_t num_fixed_points = 0;
  // The positions that the certificate takes as known within a radius, and
  // where this model has these cameras and points.
  std::vector<SupportPosition> positions;
  double defect = 0;  // what rounding takes from the stated bound, relative
  std::vector<SupportObservation> support;  // worst first
};

// What a file of conflicts proves about a model, judged from the two alone.
struct ConflictVerdict {
  bool is_accepted = false;
  std::string refusal;  // one sentence; empty if accepted
  // At least this many observations must go for all others to be within
  // max_error; meaningful only if accepted.
  int64_t num_conflicts = 0;
  int64_t num_observations = 0;  // in all conflicts together
  double max_error = 0;          // true pixels
  // Whether the file gives each observation a bound of its own; then max_error
  // is the largest of them.
  bool has_own_bounds = false;
};

// Accepts if the file's digest is that of the model and its multipliers prove
// the bound for the observations that it lists. The model's translations and
// points do not matter, except those that the certificate takes as fixed.
// Requires a valid model. Throws ModelError, with the place in the text, if it
// is not a certificate. O(observations), and the check: far less than a solve.
CertificateVerdict VerifyCertificate(const Model& model,
                                     const std::string& json);

// Likewise for conflicts: accepts if no observation is in two of them and each
// of them proves an error above the bound.
ConflictVerdict VerifyConflicts(const Model& model, const std::string& json);

// Reads a file of either kind. Throws ModelError if it cannot be read.
std::string ReadCertificate(const std::filesystem::path& path);

// Writes a file of either kind, as a whole or not at all. Throws WriteError.
void WriteCertificate(const std::string& json,
                      const std::filesystem::path& path);

}  // namespace krot
