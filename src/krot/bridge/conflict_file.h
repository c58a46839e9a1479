#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "krot/bridge/bridge.h"
#include "krot/bridge/certificate_file.h"
#include "krot/certificate.h"
#include "krot/math/norm.h"
#include "krot/model.h"

namespace krot::internal {

inline constexpr int kConflictFileVersion = 1;

// Conflicts without a common observation, in terms of the model's ids: a proof
// that as many observations at least must go for all others to be within a
// bound (docs/formats.md). Each is a certificate of version 2 whose lower bound
// is above it.
struct ConflictFile {
  struct Conflict {
    double lower_bound = 0;  // true pixels; > max_error
    double rows_bound = 0;   // delta of the rows, pixels
    double defect = 0;       // of the rows' identities, relative
    std::vector<CertificateFile::SupportObservation> observations;
  };

  int version = kConflictFileVersion;
  Norm norm;
  double max_error = 0;  // the bound, true pixels
  std::string model_sha256;
  std::vector<Conflict> conflicts;
};

// `certificates` must be of built.problem.
ConflictFile DescribeConflicts(
    const Model& model, const BuiltProblem& built, Norm norm, double max_error,
    const std::vector<PixelCertificate>& certificates);

// JSON. Doubles come back with the same bits.
std::string ConflictJson(const ConflictFile& file);

// Whether a file is one of conflicts, rather than one of a certificate.
bool HoldsConflicts(const std::string& json);

// The inverse of ConflictJson. Throws ModelError as ParseCertificate does, and
// says nothing about what is proved.
ConflictFile ParseConflicts(const std::string& json,
                            const std::string& file_name);

// Accepts if the digest of the model agrees, no observation is in two
// conflicts, and CheckPixelCertificate accepts every one of them with a bound
// above max_error. Translations and points do not enter, as with
// VerifyCertificateFile. Requires a valid model; throws what BuildProblem does.
ConflictVerdict VerifyConflictFile(const Model& model,
                                   const ConflictFile& file);

}  // namespace krot::internal
