#pragma once

#include <string>
#include <vector>

#include "krot/bridge/certificate_file.h"
#include "krot/model/model.h"

namespace krot {

// What a certificate says about a model, judged from the two alone.
struct CertificateVerdict {
  struct SupportObservation {
    ImageId image_id = 0;
    std::string image_name;
    uint32_t point2D_idx = 0;
    Point3DId point3D_id = 0;
    double multiplier = 0;  // lambda, of a sum of 1
    double error_px = 0;    // the model's own residual, linearised pixels
  };

  bool is_accepted = false;
  std::string refusal;  // one sentence; empty if accepted
  // The rest is meaningful only if accepted.
  double lower_bound = 0;   // proved, linearised pixels
  double cost = 0;          // of the model as it is, linearised pixels
  double relative_gap = 0;  // (cost - lower_bound) / cost
  double defect = 0;        // what rounding takes from the stated bound
  std::vector<SupportObservation> support;  // worst first
};

// Accepts if the digest of the model agrees, every observation is one of the
// problem that BuildProblem makes of the model, its u and J are those of the
// model to 1e-9, and CheckCertificate accepts the multipliers for the problem
// with the file's u and J. Requires a valid model; throws what BuildProblem
// does. O(observations), and CheckCertificate.
CertificateVerdict VerifyCertificateFile(const Model& model,
                                         const CertificateFile& file);

}  // namespace krot
