#include "krot/pipeline/stages.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/base/context.h"
#include "krot/convert/certificate_file.h"
#include "krot/convert/reprojection.h"
#include "krot/joint/joint.h"
#include "krot/problem/subset.h"
#include "krot/proof/certificate.h"

namespace krot::internal {
namespace {

// If lenses lower the bound by less than this, relative, another solve is not
// worth its time.
constexpr double kNegligibleLoss = 1e-6;

// For a certificate whose rows have been taken anew since it was made: repairs
// its multipliers for the new rows, which is cheaper than solving them.
std::optional<PixelCertificate> ProveByRepair(const Model& model,
                                              const BuiltProblem& built,
                                              const Estimate& x_hat, Norm norm,
                                              const Certificate& certificate,
                                              double sufficient,
                                              const Context& context) {
  std::vector<int64_t> support;
  std::vector<Multiplier> multipliers;
  for (const CertifiedObservation& o : certificate.observations) {
    support.push_back(o.observation);
    multipliers.push_back({o.lambda, o.y});
  }
  const ProblemSubset part(built.problem, support);
  CertificateOptions options;
  options.sufficient_bound = (1 + kNegligibleLoss) * sufficient;
  const std::optional<Certificate> repaired =
      RepairCertificate(part.problem(), norm, part.Restrict(x_hat), multipliers,
                        options, context);
  if (!repaired) return std::nullopt;
  const Certificate rows = InWhole(part, *repaired);
  return MakePixelCertificate(model, built, norm, rows,
                              BearingsOfPoints(model, built, x_hat, rows),
                              context);
}

}  // namespace

std::optional<PixelCertificate> ProveInPixels(const Model& model,
                                              const BuiltProblem& built,
                                              const Estimate& x_hat, Norm norm,
                                              std::vector<int64_t> support,
                                              double sufficient,
                                              const Context& context) {
  std::vector<double> widths(support.size(), 1);
  std::optional<PixelCertificate> best;
  std::vector<int64_t> at_folds;
  JointOptions options;
  options.norm = norm;
  options.relative_gap = 1e-7;  // far below any that users ask for
  for (int solve = 0; solve < 4 && !support.empty(); ++solve) {
    const ProblemSubset part(built.problem, support);
    KnownRotationProblem rows = part.problem();
    for (size_t n = 0; n < support.size(); ++n) {
      rows.observations[n].E.bottomRows<2>() /= widths[n];
    }
    Estimate estimate = part.Restrict(x_hat);
    const JointSummary summary = SolveJoint(rows, options, context, &estimate);
    if (!summary.certificate) return best;
    Certificate certificate = *summary.certificate;
    for (CertifiedObservation& o : certificate.observations) {
      o.y /= widths[o.observation];
    }
    certificate = InWhole(part, std::move(certificate));
    if (!LevelPositions(built, &certificate)) return best;
    const std::vector<Eigen::Vector3d> bearings =
        BearingsOfPoints(model, built, x_hat, certificate);
    const std::optional<PixelCertificate> candidate = MakePixelCertificate(
        model, built, norm, certificate, bearings, context);
    if (candidate && (!best || candidate->lower_bound > best->lower_bound)) {
      best = candidate;
      best->at_folds = at_folds;
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
    std::vector<int64_t> left;
    std::vector<double> widths_left;
    for (size_t n = 0; n < lines.size(); ++n) {
      const int64_t i = certificate.observations[n].observation;
      if (!std::isfinite(lines[n])) {
        at_folds.push_back(i);
        continue;
      }
      const auto place = std::lower_bound(support.begin(), support.end(), i);
      double width = widths[place - support.begin()];
      if (built.HasPixel(i)) {  // rows of positions are never widened
        width *= std::max(1.0, lines[n] * certificate.lower_bound / level);
      }
      left.push_back(i);
      widths_left.push_back(width);
    }
    std::sort(at_folds.begin(), at_folds.end());
    support = std::move(left);
    widths = std::move(widths_left);
  }
  return best;
}

namespace {

void NameValues(StepValues* values, std::optional<PixelCertificate>* proof) {
  values->Optional(proof, [&](PixelCertificate* p) {
    values->Value(&p->lower_bound);
    values->Value(&p->rows.lower_bound);
    values->Value(&p->rows.defect);
    values->OnFirst(&p->rows.observations);
    values->OnFirst(&p->bearings);
    values->OnFirst(&p->at_folds);
  });
}

// Proves on this rank alone. `certificate` is null if it has rows other than
// those of `built`, as of trust regions; then only its support is used.
std::optional<PixelCertificate> ProveHere(const Model& model,
                                          const BuiltProblem& built,
                                          const Estimate& x_hat, Norm norm,
                                          const Certificate* certificate,
                                          const std::vector<int64_t>& support,
                                          double sufficient,
                                          const Context& context) {
  if (certificate != nullptr && Reprojection(model, built).IsLinear()) {
    return MakePixelCertificate(
        model, built, norm, *certificate,
        BearingsOfPoints(model, built, x_hat, *certificate), context);
  }
  // To solve a large support as a problem of its own would take as long as the
  // whole problem did.
  if (certificate != nullptr && support.size() > 20000) {
    return ProveByRepair(model, built, x_hat, norm, *certificate, sufficient,
                         context);
  }
  return ProveInPixels(model, built, x_hat, norm, support, sufficient, context);
}

std::optional<PixelCertificate> ProveSharedRows(
    const Model& model, const BuiltProblem& built, const Estimate& x_hat,
    Norm norm, const RowsCertificate& rows, double sufficient,
    const Context& context) {
  Ranks& ranks = *context.ranks;
  const Context here = WithoutRanks(context);
  const std::vector<int64_t>& observation_of = rows.observation_of;
  const auto num_rows = static_cast<int64_t>(
      observation_of.empty() ? built.problem.observations.size()
                             : observation_of.size());
  std::vector<int64_t> own;
  for (const int64_t i : OwnSupport(rows.certificate, num_rows, &ranks)) {
    const int64_t row = observation_of.empty() ? i : observation_of[i];
    if (row >= 0) own.push_back(row);
  }
  const GatheredSupport gathered =
      GatherSupport(model, built, x_hat, own, &ranks);
  std::optional<PixelCertificate> proof;
  if (ranks.IsFirst()) {
    std::optional<Certificate> of_built;
    if (observation_of.empty()) {
      of_built = gathered.FromWhole(rows.certificate);
    }
    proof = ProveHere(gathered.model, gathered.built, gathered.estimate, norm,
                      of_built ? &*of_built : nullptr, gathered.observations,
                      sufficient, here);
    if (proof) {
      proof->rows = gathered.ToWhole(std::move(proof->rows));
      proof->at_folds.clear();
    }
  }
  bool is_proved = proof.has_value();
  ranks.Broadcast(&is_proved);
  if (!is_proved) return std::nullopt;
  if (!proof) proof.emplace();
  ranks.Broadcast(&proof->lower_bound);
  return proof;
}

}  // namespace

std::optional<PixelCertificate> ProveRows(
    const Model& model, const BuiltProblem& built, const Estimate& x_hat,
    const SolveModelOptions& options, const RowsCertificate& rows,
    double sufficient, const Context& context) {
  std::optional<PixelCertificate> proof;
  const auto prove = [&] {
    if (context.ranks != nullptr) {
      proof = ProveSharedRows(model, built, x_hat, options.norm, rows,
                              sufficient, context);
    } else {
      proof =
          ProveHere(model, built, x_hat, options.norm,
                    rows.observation_of.empty() ? &rows.certificate : nullptr,
                    SupportOf(rows), sufficient, context);
    }
  };
  RunStep(options.checkpoint, context, prove,
          [&](StepValues* values) { NameValues(values, &proof); });
  return proof;
}

std::vector<int64_t> SupportOf(const RowsCertificate& rows) {
  std::vector<int64_t> support;
  for (const CertifiedObservation& o : rows.certificate.observations) {
    const int64_t i = rows.observation_of.empty()
                          ? o.observation
                          : rows.observation_of[o.observation];
    if (i >= 0) support.push_back(i);
  }
  return support;
}

namespace {

// Certify where ranks share the points: the first rank, which has the
// certificate with indices of the whole problem, gathers the support and checks
// it.
void CertifyShared(const Model& model, const BuiltProblem& built,
                   const Estimate& estimate, const SolveModelOptions& options,
                   const Context& context, PixelCertificate certificate,
                   SolveSummary* summary) {
  Ranks& ranks = *context.ranks;
  const auto count = static_cast<int64_t>(built.problem.observations.size());
  const GatheredSupport support =
      GatherSupport(model, built, estimate,
                    OwnSupport(certificate.rows, count, &ranks), &ranks);
  if (!ranks.IsFirst()) return;
  certificate.rows = support.FromWhole(std::move(certificate.rows));
  Certify(support.model, support.built, support.estimate, options,
          WithoutRanks(context), std::move(certificate), summary);
}

}  // namespace

void Certify(const Model& model, const BuiltProblem& built,
             const Estimate& estimate, const SolveModelOptions& options,
             const Context& context,
             std::optional<PixelCertificate> certificate,
             SolveSummary* summary) {
  if (!certificate) return;
  if (context.ranks != nullptr) {
    CertifyShared(model, built, estimate, options, context,
                  std::move(*certificate), summary);
    return;
  }
  const Timer timer;
  const PixelCertificateCheck check =
      LowerUntilAccepted(model, built, options.norm, context, &*certificate);
  if (check.is_accepted) {
    summary->is_certified = true;
    summary->lower_bound = check.lower_bound;
    summary->support =
        ListSupport(model, built, estimate, options.norm, certificate->rows);
    summary->support_positions =
        ListSupportPositions(model, built, estimate, *certificate);
    summary->at_folds = ListFolds(model, built, certificate->at_folds);
    if (options.describe_certificate) {
      summary->certificate =
          DescribeCertificate(model, built, options.norm, *certificate);
    }
  }
  summary->seconds_certify = timer.Seconds();
}

void CertifyInfeasible(const Model& model, const BuiltProblem& built,
                       const SolveModelOptions& options, const Context& context,
                       const std::optional<Certificate>& certificate,
                       SolveSummary* summary) {
  if (!certificate) return;
  Certificate levelled = *certificate;
  if (!LevelPositions(built, &levelled)) return;
  Certify(
      model, built, built.start, options, context,
      MakePixelCertificate(model, built, options.norm, levelled,
                           BearingsOfPixels(model, built, levelled), context),
      summary);
}

}  // namespace krot::internal
