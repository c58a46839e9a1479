#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "krot/bridge/certificate_file.h"
#include "krot/bridge/certificate_support.h"
#include "krot/certificate.h"
#include "krot/model.h"

namespace krot::internal {

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

}  // namespace krot::internal
