#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// A proof in true pixels: no translations and points bring every reprojection
// error of the support below `lower_bound`.
//
// Let S_i be the rays of observation i whose true error is at most gamma, of
// the region that krot/camera/remainder_bound.h speaks of. The multipliers of
// `rows`, with x_cam at depth w_i and v_i = w_i L_i(u) linear in it, satisfy
//
//   sum_i (delta lambda_i w_i + y_i'v_i) <= 0      for all translations, points
//
// (certificate_check.h, (1) and (2)). If every support line keeps to its side,
//
//   (3)  -y_i'L_i(u) <= delta lambda_i             for all u in S_i,
//
// then no estimate has all its rays in the interior of the S_i. So whatever a
// lens does, it enters by the support function of S_i in the one direction
// -y_i; at an optimum that direction is the error's own, its supporting line
// touches S_i where the point projects, and gamma = delta.
//
// Where observations have scales, the true error and L_i are those over them:
// S_i are the rays within gamma times the scale.
//
// Where positions are known, z is of estimates that keep them alone: their rows
// are those of `level` delta (reprojection.h), within which every camera in
// its ball is seen.
struct PixelCertificate {
  // Of the problem whose row i is RowAtProjection at bearings[i].
  Certificate rows;
  // In the cameras' frames, one per observation of the support; of a
  // position's row its p, in the world's.
  std::vector<Eigen::Vector3d> bearings;
  double lower_bound = 0;  // gamma, true pixels; <= rows.lower_bound
};

struct PixelCertificateCheck {
  bool is_accepted = false;
  double lower_bound = 0;  // true pixels; 0 unless accepted
  double defect = 0;       // of the rows' certificate, relative
  std::string refusal;     // one sentence; empty if accepted
};

// Judges a certificate from the model alone: rows, forces and support lines are
// computed anew, with bounds on every rounding. `built` only names the
// observations. Whatever is wrong is a refusal and never an exception.
PixelCertificateCheck CheckPixelCertificate(const Model& model,
                                            const BuiltProblem& built,
                                            Norm norm,
                                            const PixelCertificate& certificate,
                                            const Context& context);

// The same of a certificate as it is or, if it is refused, up to 1e-6 lower:
// its making leaves room for roundings by a guess, which a multiplier that is
// tiny beside the others may exceed.
PixelCertificateCheck LowerUntilAccepted(const Model& model,
                                         const BuiltProblem& built, Norm norm,
                                         const Context& context,
                                         PixelCertificate* certificate);

// Where the rows of a certificate's observations were taken: at the points of
// an estimate, or, for a start from nothing, at the pixels' own rays.
std::vector<Eigen::Vector3d> BearingsOfPoints(const Model& model,
                                              const BuiltProblem& built,
                                              const Estimate& x_hat,
                                              const Certificate& rows);
std::vector<Eigen::Vector3d> BearingsOfPixels(const Model& model,
                                              const BuiltProblem& built,
                                              const Certificate& rows);

// The certificate with the largest gamma for these rows, which were taken at
// `bearings`; none without observations, or if one has no region. Verifies
// nothing.
std::optional<PixelCertificate> MakePixelCertificate(
    const Model& model, const BuiltProblem& built, Norm norm,
    const Certificate& rows, std::vector<Eigen::Vector3d> bearings,
    const Context& context);

// Per observation of `rows`, taken at `bearings`, its (3): the largest -y_i'L_i
// over S_i at `gamma` pixels, relative to delta lambda_i: at most 1 where it
// holds. What is at most `sufficient` is not found any better. Infinity without
// a region.
std::vector<double> SupportLines(const Model& model, const BuiltProblem& built,
                                 Norm norm, const Certificate& rows,
                                 const std::vector<Eigen::Vector3d>& bearings,
                                 double gamma, double sufficient,
                                 const Context& context);

}  // namespace krot::internal
