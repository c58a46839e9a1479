#include "krot/convert/pixel_certificate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/camera/camera_model.h"
#include "krot/camera/remainder_bound.h"
#include "krot/convert/reprojection.h"

namespace krot::internal {
namespace {

// Leaves room for the changes of the multipliers that the check allows for.
constexpr double kMargin = 1e-9;
// Support lines that are found in parallel; those after them can use the
// highest one so far.
constexpr int64_t kLinesAtOnce = 32;

std::string NameOf(const Model& model, const BuiltProblem& built, int64_t i) {
  if (!built.HasPixel(i)) return "a position";
  return "observation " + std::to_string(built.point2D_of[i]) + " of image " +
         std::to_string(
             model.images[built.image_of[built.problem.observations[i].view]]
                 .id);
}

// Evaluates (3) for observation n of the support, at its bearing.
double LineAt(const Reprojection& reprojection, const BuiltProblem& built,
              Norm norm, const Certificate& rows,
              const std::vector<Eigen::Vector3d>& bearings, int64_t n,
              double gamma, double sufficient) {
  const CertifiedObservation& o = rows.observations[n];
  if (!built.HasPixel(o.observation)) {
    return o.y.norm() / (o.lambda * (1 + kPositionSlack));
  }
  const Intrinsics& source = reprojection.SourceOf(o.observation);
  const double unit = rows.lower_bound * o.lambda;
  const double scale = built.ScaleOf(o.observation);
  const std::optional<double> largest =
      SupportBound(source, built.pixels[o.observation], bearings[n],
                   o.y / scale, scale * gamma, norm.p, sufficient * unit);
  return largest ? *largest / unit : kInfinity;
}

// The highest support line, or `sufficient` if all are below it. Lines that are
// lower than others are not computed exactly.
double HighestLine(const Reprojection& reprojection, const BuiltProblem& built,
                   Norm norm, const Certificate& rows,
                   const std::vector<Eigen::Vector3d>& bearings, double gamma,
                   double sufficient, const Context& context) {
  const int64_t count = static_cast<int64_t>(rows.observations.size());
  double highest = sufficient;
  for (int64_t begin = 0; begin < count; begin += kLinesAtOnce) {
    std::array<double, kLinesAtOnce> lines = {};
    ParallelFor(std::min(kLinesAtOnce, count - begin), 1, context.num_threads,
                [&](int64_t n, int64_t, int) {
                  lines[n] = LineAt(reprojection, built, norm, rows, bearings,
                                    begin + n, gamma, highest);
                });
    highest = std::max(highest, *std::max_element(lines.begin(), lines.end()));
    if (highest == kInfinity) break;
  }
  return highest;
}

// Whether (3) holds for observation n of the support for all changes of its
// multipliers that rounding may require.
bool KeepsToItsSide(const Reprojection& reprojection, const BuiltProblem& built,
                    Norm norm, const PixelCertificate& certificate,
                    const MultiplierChange& change, size_t n) {
  const CertifiedObservation& o = certificate.rows.observations[n];
  if (!built.HasPixel(o.observation)) {
    return o.y.norm() + change.y <=
           o.lambda * (1 - change.depth) * (1 + kPositionSlack / 2);
  }
  const Intrinsics& source = reprojection.SourceOf(o.observation);
  const double gamma = certificate.lower_bound;
  // It need not be known more exactly than to a tenth: it only scales an
  // allowance for rounding.
  const std::optional<double> kappa = RemainderBound(
      source, built.pixels[o.observation], certificate.bearings[n],
      built.ScaleOf(o.observation) * gamma, norm.p, 0.1);
  if (!kappa) return false;
  // |L| <= sqrt(2) |L|_p over S_i; both sides are divided by the scale, of
  // which gamma is a bound.
  const double reach =
      1.5 * gamma * (1 + *kappa) / (certificate.rows.lower_bound * o.lambda);
  const double allowance = change.y * reach + change.depth;
  const double line =
      LineAt(reprojection, built, norm, certificate.rows, certificate.bearings,
             static_cast<int64_t>(n), gamma, 1 - 2 * allowance);
  return line + allowance <= 1;
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
        built.HasPixel(o.observation)
            ? reprojection.InCamera(x_hat, o.observation).normalized()
            : ApexAt(built, x_hat, o.observation));
  }
  return bearings;
}

std::vector<Eigen::Vector3d> BearingsOfPixels(const Model& model,
                                              const BuiltProblem& built,
                                              const Certificate& rows) {
  const Reprojection reprojection(model, built);
  std::vector<Eigen::Vector3d> bearings;
  for (const CertifiedObservation& o : rows.observations) {
    if (!built.HasPixel(o.observation)) {
      bearings.push_back(ApexOfStart(built, o.observation));
      continue;
    }
    const Intrinsics& source = reprojection.SourceOf(o.observation);
    bearings.push_back(PixelBearing(source, built.pixels[o.observation])
                           .value_or(Eigen::Vector3d::Zero()));
  }
  return bearings;
}

std::vector<double> SupportLines(const Model& model, const BuiltProblem& built,
                                 Norm norm, const Certificate& rows,
                                 const std::vector<Eigen::Vector3d>& bearings,
                                 double gamma, double sufficient,
                                 const Context& context) {
  const Reprojection reprojection(model, built);
  std::vector<double> lines(rows.observations.size());
  ParallelFor(static_cast<int64_t>(lines.size()), 1, context.num_threads,
              [&](int64_t n, int64_t, int) {
                lines[n] = LineAt(reprojection, built, norm, rows, bearings, n,
                                  gamma, sufficient);
              });
  return lines;
}

std::optional<PixelCertificate> MakePixelCertificate(
    const Model& model, const BuiltProblem& built, Norm norm,
    const Certificate& rows, std::vector<Eigen::Vector3d> bearings,
    const Context& context) {
  if (rows.observations.empty()) return std::nullopt;
  const Reprojection reprojection(model, built);
  PixelCertificate certificate{rows, std::move(bearings), 0, {}};
  double gamma = rows.lower_bound * (1 - kMargin);
  // Corrections of gamma; mostly two are enough.
  for (int n = 0; n < 8; ++n) {
    const double highest =
        HighestLine(reprojection, built, norm, rows, certificate.bearings,
                    gamma, 1 - kMargin / 2, context);
    if (!std::isfinite(highest)) return std::nullopt;
    if (highest <= 1 - kMargin / 2) {
      certificate.lower_bound = gamma;
      return certificate;
    }
    gamma *= (1 - kMargin) / highest;
  }
  return std::nullopt;
}

PixelCertificateCheck CheckPixelCertificate(const Model& model,
                                            const BuiltProblem& built,
                                            Norm norm,
                                            const PixelCertificate& certificate,
                                            const Context& context) {
  const auto refused = [](const std::string& refusal) {
    PixelCertificateCheck check;
    check.refusal = refusal;
    return check;
  };
  const std::vector<CertifiedObservation>& support =
      certificate.rows.observations;
  const double gamma = certificate.lower_bound;
  if (!(gamma > 0) || !std::isfinite(gamma)) {
    return refused("its lower bound is no positive number");
  }
  if (certificate.bearings.size() != support.size()) {
    return refused("it has not one bearing per observation");
  }
  const Reprojection reprojection(model, built);
  KnownRotationProblem problem = built.problem;
  for (size_t n = 0; n < support.size(); ++n) {
    const int64_t i = support[n].observation;
    if (i < 0 || i >= static_cast<int64_t>(problem.observations.size())) {
      return refused("it names an observation that is not there");
    }
    if (!built.HasPixel(i)) {
      if (PutPositionRow(built, i, certificate.bearings[n],
                         certificate.rows.lower_bound, &problem)) {
        continue;
      }
      return refused("an apex is too near to its position, or too far");
    }
    const Intrinsics& source = reprojection.SourceOf(i);
    const auto row =
        RowAtProjection(source, built.pixels[i], certificate.bearings[n]);
    if (!row) {
      return refused("the bearing of " + NameOf(model, built, i) +
                     " does not project");
    }
    problem.observations[i].E = *row;
    problem.observations[i].E.bottomRows<2>() /= built.ScaleOf(i);
  }
  const CertificateCheck rows =
      CheckCertificate(problem, norm, certificate.rows);
  if (!rows.is_accepted) return refused(rows.refusal);
  std::vector<char> keeps(support.size(), 0);
  for (size_t begin = 0; begin < support.size(); begin += kLinesAtOnce) {
    const size_t end = std::min<size_t>(support.size(), begin + kLinesAtOnce);
    ParallelFor(static_cast<int64_t>(end - begin), 1, context.num_threads,
                [&](int64_t n, int64_t, int) {
                  keeps[begin + n] =
                      KeepsToItsSide(reprojection, built, norm, certificate,
                                     rows.changes[begin + n], begin + n);
                });
    for (size_t n = begin; n < end; ++n) {
      if (keeps[n]) continue;
      return refused(NameOf(model, built, support[n].observation) +
                     " may be seen below the bound on the far side of its "
                     "support line");
    }
  }
  return {true, gamma, rows.defect, ""};
}

PixelCertificateCheck LowerUntilAccepted(const Model& model,
                                         const BuiltProblem& built, Norm norm,
                                         const Context& context,
                                         PixelCertificate* certificate) {
  const double bound = certificate->lower_bound;
  PixelCertificateCheck check =
      CheckPixelCertificate(model, built, norm, *certificate, context);
  for (const double share : {1e-8, 1e-7, 1e-6}) {
    if (check.is_accepted) break;
    certificate->lower_bound = (1 - share) * bound;
    check = CheckPixelCertificate(model, built, norm, *certificate, context);
  }
  return check;
}

}  // namespace krot::internal
