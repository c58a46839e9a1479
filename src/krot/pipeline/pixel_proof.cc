#include "krot/pipeline/pixel_proof.h"

#include <algorithm>
#include <cmath>

#include "krot/bridge/position_rows.h"
#include "krot/joint/joint.h"
#include "krot/problem/subset.h"

namespace krot {
namespace {

// Of the support's own problem: far below any gap that is asked for.
constexpr double kGap = 1e-7;
// A bound that loses less than this, relative, to the lenses is not worth
// another solve.
constexpr double kNegligibleLoss = 1e-6;
constexpr int kMaxSolves = 4;

}  // namespace

std::optional<PixelCertificate> ProveInPixels(const Model& model,
                                              const BuiltProblem& built,
                                              const Estimate& x_hat, Norm norm,
                                              std::vector<int64_t> support,
                                              double sufficient,
                                              const Context& context) {
  KnownRotationProblem rows = built.problem;
  std::vector<double> widths(rows.observations.size(), 1);
  std::optional<PixelCertificate> best;
  JointOptions options;
  options.norm = norm;
  options.relative_gap = kGap;
  for (int solve = 0; solve < kMaxSolves && !support.empty(); ++solve) {
    const ProblemSubset part(rows, support);
    Estimate estimate = part.Restrict(x_hat);
    const JointSummary summary =
        SolveJoint(part.problem(), options, context, &estimate);
    if (!summary.certificate) return best;
    Certificate certificate = InWhole(part, *summary.certificate);
    for (CertifiedObservation& o : certificate.observations) {
      o.y /= widths[o.observation];
    }
    LevelPositions(built, &certificate);
    const std::vector<Eigen::Vector3d> bearings =
        BearingsOfPoints(model, built, x_hat, certificate);
    const std::optional<PixelCertificate> candidate = MakePixelCertificate(
        model, built, norm, certificate, bearings, context);
    if (candidate && (!best || candidate->lower_bound > best->lower_bound)) {
      best = candidate;
    }
    if (best &&
        (best->lower_bound >= sufficient ||
         best->lower_bound > (1 - kNegligibleLoss) * certificate.lower_bound)) {
      return best;
    }
    const double level =
        candidate ? candidate->lower_bound : certificate.lower_bound;
    const std::vector<double> lines =
        SupportLines(model, built, norm, certificate, bearings, level,
                     level / certificate.lower_bound, context);
    support.clear();
    for (size_t n = 0; n < lines.size(); ++n) {
      if (!std::isfinite(lines[n])) continue;
      const int64_t i = certificate.observations[n].observation;
      if (!built.HasPixel(i)) {  // whatever the bound, its row is the ball's
        support.push_back(i);
        continue;
      }
      const double wider =
          std::max(1.0, lines[n] * certificate.lower_bound / level);
      widths[i] *= wider;
      rows.observations[i].E.bottomRows<2>() /= wider;
      support.push_back(i);
    }
  }
  return best;
}

std::vector<int64_t> SupportOf(const Certificate& certificate,
                               const std::vector<int64_t>& observation_of) {
  std::vector<int64_t> support;
  for (const CertifiedObservation& o : certificate.observations) {
    const int64_t i =
        observation_of.empty() ? o.observation : observation_of[o.observation];
    if (i >= 0) support.push_back(i);
  }
  return support;
}

}  // namespace krot
