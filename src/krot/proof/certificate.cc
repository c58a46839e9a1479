#include "krot/proof/certificate.h"

#include "krot/base/check.h"
#include "krot/problem/components.h"
#include "krot/problem/subset.h"
#include "krot/proof/certificate_search.h"
#include "krot/proof/support.h"

namespace krot::internal {
namespace {

// Smaller multipliers, by the largest, are left out at first: a smaller
// support is easier to balance, but may lack what decides.
constexpr double kSharesOfLargest[] = {1e-3, 1e-5, 0};
// The same beside the supports by scores.
constexpr double kSharesBesideScores[] = {1e-3, 1e-5};
// Of SelectSupport, the cheapest first: a strict one gives a small support,
// which may lack what decides. Multipliers that matter span eight decades.
constexpr double kThresholds[] = {1e2, 1, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6};
// What exceeds this one sets the maximum, or nearly so. Where that has many
// unknowns it is not to be found among what comes close: a solve of a part
// takes as long as a repair of all, and shows less.
constexpr double kSurelyInSupport = 1;
constexpr int64_t kManyUnknowns = 5000;

void CheckInput(const KnownRotationProblem& problem,
                const std::vector<Multiplier>& multipliers,
                const CertificateOptions& options) {
  CheckArgument(multipliers.size() == problem.observations.size(),
                "multipliers.size()", multipliers.size(),
                "the number of observations");
  CheckAtLeast(1, options.max_unknowns, "options.max_unknowns");
}

bool IsSpread(const KnownRotationProblem& problem,
              const std::vector<double>& scores) {
  const std::vector<int64_t> support =
      SelectSupport(problem, scores, kSurelyInSupport);
  return NumUnknowns(ProblemSubset(problem, support).problem()) > kManyUnknowns;
}

}  // namespace

std::optional<Certificate> MakeCertificate(
    const KnownRotationProblem& problem, Norm norm, const Estimate& estimate,
    double gamma, const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options, const Context& context) {
  CheckInput(problem, multipliers, options);
  const std::vector<double> scores =
      SupportScores(problem, norm, estimate, gamma, multipliers);
  CertificateSearch search(problem, norm, options, context);
  const auto try_supports = [&](bool solve) {
    std::vector<int64_t> previous;
    for (const double threshold : kThresholds) {
      const std::vector<int64_t> support =
          SelectSupport(problem, scores, threshold);
      if (support == previous) continue;
      previous = support;
      for (const std::vector<int64_t>& component :
           SplitIntoComponents(problem, support)) {
        search.Try(component, estimate, multipliers,
                   solve ? std::optional(threshold) : std::nullopt);
        if (search.IsEnough()) return;
      }
    }
  };
  const bool is_spread = IsSpread(problem, scores);
  try_supports(/*solve=*/!is_spread);
  if (is_spread && !search.IsEnough()) search.TryAll(estimate, multipliers);
  if (is_spread || search.IsEnough()) return search.best();
  // Scores do not tell an observation whose depth vanishes at the optimum.
  const double delta = SuggestedBound(problem, estimate, multipliers);
  for (const double share : kSharesBesideScores) {
    search.TryBalanced(delta, multipliers, SelectLarge(multipliers, share));
    if (search.IsEnough()) break;
  }
  return search.best();
}

std::optional<Certificate> MakeInfeasibilityCertificate(
    const KnownRotationProblem& problem, Norm norm, double bound,
    const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options, const Context& context) {
  CheckInput(problem, multipliers, options);
  CertificateSearch search(problem, norm, options, context);
  for (const double share : kSharesOfLargest) {
    search.TryBalanced(bound, multipliers, SelectLarge(multipliers, share));
    if (search.IsEnough()) break;
  }
  return search.best();
}

Certificate InWhole(const ProblemSubset& part, Certificate certificate) {
  for (CertifiedObservation& o : certificate.observations) {
    o.observation = part.InWhole(o.observation);
  }
  return certificate;
}

}  // namespace krot::internal
