#include "krot/pipeline/certify.h"

#include <utility>

#include "krot/base/timer.h"
#include "krot/bridge/gathered_support.h"
#include "krot/bridge/position_rows.h"

namespace krot::internal {
namespace {

// By the first rank, which has the certificate, in the numbers of the whole.
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
