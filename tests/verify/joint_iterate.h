#pragma once

#include <optional>
#include <vector>

#include "krot/conic/interior_point.h"
#include "krot/proof/certificate.h"

namespace krot::internal {

// Where an interior point stops on a connected problem.
struct JointIterate {
  Estimate estimate;
  double gamma = 0;
  std::vector<Multiplier> multipliers;
};

inline JointIterate SolveToGap(const KnownRotationProblem& problem, Norm norm,
                               const Estimate& start, double gap) {
  JointIterate iterate;
  InteriorPointOptions options;
  options.norm = norm;
  options.smallest_gap = gap;
  options.stop = [&](const ConicIterate& current) {
    iterate.estimate = *current.estimate;
    return false;
  };
  Estimate estimate = start;
  iterate.gamma =
      MinimizeJointly(problem, options, {}, &estimate, &iterate.multipliers)
          .gamma;
  return iterate;
}

inline std::optional<Certificate> Certify(
    const KnownRotationProblem& problem, Norm norm, const JointIterate& iterate,
    const CertificateOptions& options = {}) {
  return MakeCertificate(problem, norm, iterate.estimate, iterate.gamma,
                         iterate.multipliers, options, {});
}

}  // namespace krot::internal
