#pragma once

#include <optional>

#include "krot/convert/build_problem.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/convert/reprojection.h"
#include "tests/verify/joint_iterate.h"

namespace krot::internal {

// A minimum of the true errors of a connected problem, and its certificate.
struct PixelOptimum {
  Estimate estimate;
  double cost = 0;  // true, pixels
  PixelCertificate certificate;
  bool is_proved = false;
};

// From built->start, by full steps: for a start that is near. Leaves the rows
// that the certificate speaks of in *built.
inline PixelOptimum SolveInPixels(const Model& model, Norm norm,
                                  BuiltProblem* built, int num_steps = 4) {
  const Reprojection reprojection(model, *built);
  PixelOptimum optimum;
  optimum.estimate = built->start;
  Estimate x_hat;
  JointIterate iterate;
  for (int step = 0; step < num_steps; ++step) {
    x_hat = optimum.estimate;
    reprojection.TakeRows(x_hat, 1, &built->problem);
    iterate = SolveToGap(built->problem, norm, x_hat, 1e-8);
    optimum.estimate = iterate.estimate;
  }
  optimum.cost = reprojection.TrueCost(optimum.estimate, norm, 1);
  const std::optional<Certificate> rows =
      Certify(built->problem, norm, iterate);
  if (!rows) return optimum;
  const std::optional<PixelCertificate> certificate =
      MakePixelCertificate(model, *built, norm, *rows,
                           BearingsOfPoints(model, *built, x_hat, *rows), {});
  optimum.is_proved = certificate.has_value();
  if (certificate) optimum.certificate = *certificate;
  return optimum;
}

}  // namespace krot::internal
