#include "krot/bridge/pixel_certificate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "krot/base/parallel_for.h"
#include "krot/bridge/reprojection.h"
#include "krot/camera/projection_row.h"
#include "krot/camera/remainder_bound.h"

namespace krot {
namespace {

constexpr double kNoRegion = std::numeric_limits<double>::infinity();
// Corrections of gamma that MakePixelCertificate takes; two mostly do.
constexpr int kMaxCorrections = 8;
// Leaves room for the changes of the multipliers that the check allows for.
constexpr double kRoom = 1e-9;

std::string NameOf(const Model& model, const BuiltProblem& built, int64_t i) {
  return "observation " + std::to_string(built.point2D_of[i]) + " of image " +
         std::to_string(
             model.images[built.image_of[built.problem.observations[i].view]]
                 .id);
}

// (3) at the rows' bearings.
std::vector<double> LinesAt(const Reprojection& reprojection,
                            const BuiltProblem& built, Norm norm,
                            const Certificate& rows,
                            const std::vector<Eigen::Vector3d>& bearings,
                            double gamma, const Context& context) {
  std::vector<double> lines(rows.observations.size(), kNoRegion);
  ParallelFor(static_cast<int64_t>(lines.size()), 1, context.num_threads,
              [&](int64_t n, int64_t, int) {
                const CertifiedObservation& o = rows.observations[n];
                const Reprojection::Source& source =
                    reprojection.SourceOf(o.observation);
                const std::optional<double> largest = SupportBound(
                    source.model_id, source.params, built.pixels[o.observation],
                    bearings[n], o.y, gamma, norm.p);
                if (largest)
                  lines[n] = *largest / (rows.lower_bound * o.lambda);
              });
  return lines;
}

}  // namespace

std::vector<Eigen::Vector3d> BearingsOfPoints(const Model& model,
                                              const BuiltProblem& built,
                                              const Estimate& x_hat,
                                              const Certificate& rows) {
  const Reprojection reprojection(model, built);
  std::vector<Eigen::Vector3d> bearings;
  for (const CertifiedObservation& o : rows.observations) {
    bearings.push_back(
        reprojection.InCamera(x_hat, o.observation).normalized());
  }
  return bearings;
}

std::vector<Eigen::Vector3d> BearingsOfPixels(const Model& model,
                                              const BuiltProblem& built,
                                              const Certificate& rows) {
  const Reprojection reprojection(model, built);
  std::vector<Eigen::Vector3d> bearings;
  for (const CertifiedObservation& o : rows.observations) {
    const Reprojection::Source& source = reprojection.SourceOf(o.observation);
    bearings.push_back(PixelBearing(source.model_id, source.params,
                                    built.pixels[o.observation])
                           .value_or(Eigen::Vector3d::Zero()));
  }
  return bearings;
}

std::vector<double> SupportLines(const Model& model, const BuiltProblem& built,
                                 Norm norm, const Certificate& rows,
                                 const std::vector<Eigen::Vector3d>& bearings,
                                 double gamma, const Context& context) {
  return LinesAt(Reprojection(model, built), built, norm, rows, bearings, gamma,
                 context);
}

std::optional<PixelCertificate> MakePixelCertificate(
    const Model& model, const BuiltProblem& built, Norm norm,
    const Certificate& rows, std::vector<Eigen::Vector3d> bearings,
    const Context& context) {
  if (rows.observations.empty()) return std::nullopt;
  const Reprojection reprojection(model, built);
  PixelCertificate certificate{rows, std::move(bearings), 0};
  double gamma = rows.lower_bound * (1 - kRoom);
  for (int n = 0; n < kMaxCorrections; ++n) {
    const std::vector<double> lines = LinesAt(
        reprojection, built, norm, rows, certificate.bearings, gamma, context);
    const double highest = *std::max_element(lines.begin(), lines.end());
    if (!std::isfinite(highest)) return std::nullopt;
    if (highest <= 1 - kRoom / 2) {
      certificate.lower_bound = gamma;
      return certificate;
    }
    gamma *= (1 - kRoom) / highest;
  }
  return std::nullopt;
}

PixelCertificateCheck CheckPixelCertificate(const Model& model,
                                            const BuiltProblem& built,
                                            Norm norm,
                                            const PixelCertificate& certificate,
                                            const Context& context) {
  PixelCertificateCheck check;
  const std::vector<CertifiedObservation>& support =
      certificate.rows.observations;
  const double gamma = certificate.lower_bound;
  if (!(gamma > 0) || !std::isfinite(gamma)) {
    check.refusal = "its lower bound is no positive number";
    return check;
  }
  if (certificate.bearings.size() != support.size()) {
    check.refusal = "it has not one bearing per observation";
    return check;
  }
  const Reprojection reprojection(model, built);
  KnownRotationProblem problem = built.problem;
  for (size_t n = 0; n < support.size(); ++n) {
    const int64_t i = support[n].observation;
    if (i < 0 || i >= static_cast<int64_t>(problem.observations.size())) {
      check.refusal = "it names an observation that is not there";
      return check;
    }
    const Reprojection::Source& source = reprojection.SourceOf(i);
    const auto row = RowAtProjection(source.model_id, source.params,
                                     built.pixels[i], certificate.bearings[n]);
    if (!row) {
      check.refusal =
          "the bearing of " + NameOf(model, built, i) + " does not project";
      return check;
    }
    problem.observations[i].E = *row;
  }
  const CertificateCheck rows =
      CheckCertificate(problem, norm, certificate.rows);
  if (!rows.is_accepted) {
    check.refusal = rows.refusal;
    return check;
  }
  const std::vector<double> lines =
      LinesAt(reprojection, built, norm, certificate.rows, certificate.bearings,
              gamma, context);
  for (size_t n = 0; n < support.size(); ++n) {
    const int64_t i = support[n].observation;
    const Reprojection::Source& source = reprojection.SourceOf(i);
    // |L| <= sqrt(2) |L|_p over S_i.
    const std::optional<double> kappa =
        RemainderBound(source.model_id, source.params, built.pixels[i],
                       certificate.bearings[n], gamma, norm.p);
    const double reach =
        kappa ? 1.5 * gamma * (1 + *kappa) /
                    (certificate.rows.lower_bound * support[n].lambda)
              : kNoRegion;
    const MultiplierChange& change = rows.changes[n];
    if (!(lines[n] + change.y * reach + change.depth <= 1)) {
      check.refusal = NameOf(model, built, i) +
                      " may be seen below the bound on the far side of its "
                      "support line";
      return check;
    }
  }
  check.is_accepted = true;
  check.lower_bound = gamma;
  check.defect = rows.defect;
  return check;
}

}  // namespace krot
