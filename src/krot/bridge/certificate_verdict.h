#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "krot/bridge/certificate_file.h"
#include "krot/bridge/certificate_support.h"
#include "krot/model/model.h"

namespace krot {

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
  // Version 1: the bound is one of rows linearised at the observations.
  bool is_linearised = false;
  // Of those whose positions it takes as fixed.
  int64_t num_fixed_images = 0;
  int64_t num_fixed_points = 0;
  // Those that it takes as known to a radius, where this model has the cameras.
  std::vector<SupportPosition> positions;
  double defect = 0;  // what rounding takes from the stated bound
  std::vector<SupportObservation> support;  // worst first
};

// Accepts if the digest of the model agrees, every observation is one of the
// problem that BuildProblem makes of the model, and CheckPixelCertificate
// accepts the multipliers and bearings. Version 1: u and J have to be those of
// the model to 1e-9, and CheckCertificate accepts the multipliers for the rows
// of the file's u and J. Translations and points do not enter into that:
// where they keep BuildProblem from using an observation of the certificate,
// it ignores them. But what the file takes as fixed has to stand where it says,
// to the bit; and of positions within a radius it speaks as the file has them.
// Requires a valid model; throws what BuildProblem does.
// O(observations), and the check.
CertificateVerdict VerifyCertificateFile(const Model& model,
                                         const CertificateFile& file);

}  // namespace krot
