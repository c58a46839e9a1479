#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// A proof in true pixels: no translations and points bring every reprojection
// error of the support below `lower_bound`.
//
// Let S_i be the rays of observation i whose true error is at most gamma,
// within the region of krot/camera/remainder_bound.h. Let w_i be the depth of
// x_cam, and v_i = w_i L_i(u) the linear error on the ray u. The multipliers of
// `rows` satisfy
//
//   sum_i (delta lambda_i w_i + y_i'v_i) <= 0      for all translations, points
//
// (certificate_check.h, (1) and (2)). If for every observation
//
//   (3)  -y_i'L_i(u) <= delta lambda_i             for all u in S_i,
//
// then no estimate has all its rays in the interior of the S_i, so none has all
// errors below gamma. The lens matters only through (3): the line -y_i'L =
// delta lambda_i must leave S_i on one side. At an optimum, -y_i is the
// direction of the error itself, this line touches S_i where the point
// projects, and gamma = delta.
//
// If observations have scales, the true error and L_i are divided by them: S_i
// are the rays whose error is at most gamma times the scale.
//
// If positions are known, the proof is about estimates within them only. Their
// rows have the `level` delta (reprojection.h); their cones contain the whole
// region.
struct PixelCertificate {
  // For the problem whose row i is RowAtProjection at bearings[i].
  Certificate rows;
  // One per observation of the support: the ray at which its row is taken, in
  // the camera's frame; for the row of a known position its p, in the world's
  // axes.
  std::vector<Eigen::Vector3d> bearings;
  double lower_bound = 0;  // gamma, true pixels; <= rows.lower_bound
  // Observations that were left out of the support because they have no region,
  // ascending. They prove nothing.
  std::vector<int64_t> at_folds;
};

struct PixelCertificateCheck {
  bool is_accepted = false;
  double lower_bound = 0;  // true pixels; 0 unless accepted
  double defect = 0;       // of the rows' certificate, relative
  std::string refusal;     // one sentence; empty if accepted
};

// Judges a certificate from the model alone: it computes rows, gradients and
// support lines itself, with bounds on every rounding. `built` only says which
// observations are meant. Whatever is wrong is a refusal, never an exception.
PixelCertificateCheck CheckPixelCertificate(const Model& model,
                                            const BuiltProblem& built,
                                            Norm norm,
                                            const PixelCertificate& certificate,
                                            const Context& context);

// Checks the certificate as it is and, if it is refused, with a bound that is
// lower by up to 1e-6. MakePixelCertificate only guesses how much room
// roundings need; a multiplier that is tiny beside the others may need more.
PixelCertificateCheck LowerUntilAccepted(const Model& model,
                                         const BuiltProblem& built, Norm norm,
                                         const Context& context,
                                         PixelCertificate* certificate);

// The rays at which the rows of a certificate's observations were taken: at the
// points of an estimate or, for a start from nothing, at the pixels' own rays.
std::vector<Eigen::Vector3d> BearingsOfPoints(const Model& model,
                                              const BuiltProblem& built,
                                              const Estimate& x_hat,
                                              const Certificate& rows);
std::vector<Eigen::Vector3d> BearingsOfPixels(const Model& model,
                                              const BuiltProblem& built,
                                              const Certificate& rows);

// The certificate with the largest gamma for these rows, which were taken at
// `bearings`; none without observations, or if one of them has no region.
// Checks nothing.
std::optional<PixelCertificate> MakePixelCertificate(
    const Model& model, const BuiltProblem& built, Norm norm,
    const Certificate& rows, std::vector<Eigen::Vector3d> bearings,
    const Context& context);

// Evaluates (3) for each observation of `rows`, taken at `bearings`: the
// largest -y_i'L_i over S_i at `gamma` pixels, divided by delta lambda_i; (3)
// holds if it is at most 1. Values of at most `sufficient` are not made more
// exact. Infinity without a region.
std::vector<double> SupportLines(const Model& model, const BuiltProblem& built,
                                 Norm norm, const Certificate& rows,
                                 const std::vector<Eigen::Vector3d>& bearings,
                                 double gamma, double sufficient,
                                 const Context& context);

}  // namespace krot::internal
