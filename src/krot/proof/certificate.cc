#include "krot/proof/certificate.h"

#include <algorithm>
#include <utility>

#include "krot/base/check.h"
#include "krot/problem/components.h"
#include "krot/problem/subset.h"
#include "krot/proof/dual_repair.h"
#include "krot/proof/support.h"

namespace krot {
namespace {

// Of SelectBalanced. A strict one drops observations that a proof may need, a
// lax one keeps what does not balance. Tried on models with outliers together,
// never one by one.
constexpr double kBalanceTolerances[] = {1e-3, 1e-2, 3e-2, 1e-1, 3e-1};
// How often misfits are dropped and the rest is tried again, each time at the
// cost of a repair.
constexpr int kMaxDrops = 20;
// Smaller multipliers, by the largest, are left out at first: a smaller
// support is easier to balance, but may lack what decides.
constexpr double kSharesOfLargest[] = {1e-3, 1e-5, 0};
// The same beside the supports by scores.
constexpr double kSharesBesideScores[] = {1e-3, 1e-5};
// Of SelectSupport, the cheapest first: a strict one gives a small support,
// which may lack what decides. Multipliers that matter span eight decades.
constexpr double kThresholds[] = {1e2, 1, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6};
// Of the sub-problems: far below any gap that is asked for, as what is left of
// it is missing from the bound.
constexpr double kSmallestGap = 1e-9;
constexpr int kMaxIterations = 100;
// Larger ones are only worth their time if they prove enough: they are given
// up as soon as they cannot.
constexpr int64_t kLargeUnknowns = 1500;
// What a smaller support may cost of the bound, relative: far below any gap.
constexpr double kEqualBounds = 1e-7;
// How often a sub-problem is cut down to what sets its maximum.
constexpr int kMaxReductions = 4;
// The defect that a certificate states allows for another machine's
// arithmetic, which may find a little more than was found here.
constexpr double kDefectFactor = 2;
constexpr double kSmallestDefect = 1e-12;

std::vector<Multiplier> Pick(const std::vector<Multiplier>& multipliers,
                             const std::vector<int64_t>& observations) {
  std::vector<Multiplier> picked;
  for (const int64_t i : observations) picked.push_back(multipliers[i]);
  return picked;
}

// Equal bounds are told by the smaller support.
bool IsBetter(const Certificate& a, const Certificate& b) {
  const double margin = kEqualBounds * b.lower_bound;
  if (a.observations.size() < b.observations.size()) {
    return a.lower_bound > b.lower_bound - margin;
  }
  if (a.observations.size() > b.observations.size()) {
    return a.lower_bound > b.lower_bound + margin;
  }
  return a.lower_bound > b.lower_bound;
}

void CheckInput(const KnownRotationProblem& problem,
                const std::vector<Multiplier>& multipliers,
                const CertificateOptions& options) {
  CheckArgument(multipliers.size() == problem.observations.size(),
                "multipliers.size()", multipliers.size(),
                "the number of observations");
  CheckArgument(options.max_unknowns >= 1, "options.max_unknowns",
                options.max_unknowns, ">= 1");
}

// Looks for certificates among given observations in three ways, the cheapest
// first, and keeps the best that the check accepts:
//
//   as they are   repairs the multipliers in hand               Offer
//   balanced      of those, what balances, without misfits      TryBalanced
//   solved        those of the sub-problem's own optimum, then  SolveAndReduce
//                 of what sets the maximum of that, and so on
//
// Every way ends in Offer, which alone writes the best, and none goes on once
// IsEnough().
class CertificateSearch {
 public:
  CertificateSearch(const KnownRotationProblem& problem, Norm norm,
                    const CertificateOptions& options, const Context& context)
      : problem_(problem), norm_(norm), options_(options), context_(context) {}

  // Tries the multipliers of these observations, connected, as they are; then
  // those of their sub-problem, solved from `estimate` of the whole; then that
  // of what sets its maximum, and so on.
  void Try(const std::vector<int64_t>& observations, const Estimate& estimate,
           const std::vector<Multiplier>& multipliers, double threshold);

  // Tries what balances of these multipliers at `delta`, pixels.
  void TryBalanced(double delta, const std::vector<Multiplier>& multipliers,
                   const std::vector<int64_t>& candidates);

  bool IsEnough() const {
    return context_.IsCancelled() ||
           best_.lower_bound >= options_.sufficient_bound;
  }

  std::optional<Certificate> best() const {
    if (best_.observations.empty()) return std::nullopt;
    return best_;
  }

 private:
  static int64_t NumUnknowns(const KnownRotationProblem& part) {
    return 3 * (int64_t{part.num_points} + part.num_frames - 1);
  }
  void SolveAndReduce(const ProblemSubset& part, const Estimate& whole,
                      double threshold, int num_reductions);
  std::vector<int64_t> OfferBalanced(double delta,
                                     const std::vector<Multiplier>& multipliers,
                                     const std::vector<int64_t>& candidates,
                                     double tolerance);
  // Repairs the part's multipliers, and keeps what comes of them if it is
  // better than the best so far. Returns the misfits of the part.
  std::vector<int64_t> Offer(const ProblemSubset& part, double delta,
                             const std::vector<Multiplier>& multipliers);

  const KnownRotationProblem& problem_;
  const Norm norm_;
  const CertificateOptions options_;
  const Context context_;
  Certificate best_;
};

void CertificateSearch::Try(const std::vector<int64_t>& observations,
                            const Estimate& whole,
                            const std::vector<Multiplier>& multipliers,
                            double threshold) {
  const ProblemSubset part(problem_, observations);
  if (NumUnknowns(part.problem()) > options_.max_unknowns) return;
  const std::vector<Multiplier> known = Pick(multipliers, observations);
  const double delta =
      SuggestedBound(part.problem(), part.Restrict(whole), known);
  Offer(part, delta, known);
  if (!IsEnough()) TryBalanced(delta, multipliers, observations);
  if (!IsEnough()) SolveAndReduce(part, whole, threshold, kMaxReductions);
}

void CertificateSearch::TryBalanced(double delta,
                                    const std::vector<Multiplier>& multipliers,
                                    const std::vector<int64_t>& candidates) {
  for (const double tolerance : kBalanceTolerances) {
    std::vector<int64_t> left = candidates;
    for (int drop = 0; drop < kMaxDrops && !left.empty() && !IsEnough();
         ++drop) {
      left = OfferBalanced(delta, multipliers, left, tolerance);
    }
    if (IsEnough()) return;
  }
}

// The balanced ones of the candidates; returns those of them that are worth
// another try, without their misfits.
std::vector<int64_t> CertificateSearch::OfferBalanced(
    double delta, const std::vector<Multiplier>& multipliers,
    const std::vector<int64_t>& candidates, double tolerance) {
  std::vector<int64_t> left;
  const std::vector<int64_t> balanced =
      SelectBalanced(problem_, delta, multipliers, candidates, tolerance);
  for (const std::vector<int64_t>& component :
       SplitIntoComponents(problem_, balanced)) {
    const std::vector<int64_t> misfits =
        Offer(ProblemSubset(problem_, component), delta,
              Pick(multipliers, component));
    if (misfits.empty()) continue;
    auto misfit = misfits.begin();
    for (size_t n = 0; n < component.size(); ++n) {
      if (misfit != misfits.end() && *misfit == static_cast<int64_t>(n)) {
        ++misfit;
      } else {
        left.push_back(component[n]);
      }
    }
  }
  std::sort(left.begin(), left.end());
  return left;
}

void CertificateSearch::SolveAndReduce(const ProblemSubset& part,
                                       const Estimate& whole, double threshold,
                                       int num_reductions) {
  InteriorPointOptions options;
  options.norm = norm_;
  options.smallest_gap = kSmallestGap;
  options.max_iterations = kMaxIterations;
  if (NumUnknowns(part.problem()) > kLargeUnknowns) {
    // Its optimum is below every cost it reaches.
    options.stop = [this](const ConicIterate& iterate) {
      return iterate.cost < options_.sufficient_bound;
    };
  }
  Estimate estimate = part.Restrict(whole);
  std::vector<Multiplier> multipliers;
  const InteriorPointSummary summary = MinimizeJointly(
      part.problem(), options, context_, &estimate, &multipliers);
  if (summary.termination == InteriorPointTermination::kStopped) return;
  Offer(part, SuggestedBound(part.problem(), estimate, multipliers),
        multipliers);

  const std::vector<int64_t> support =
      SelectSupport(part.problem(),
                    SupportScores(part.problem(), norm_, estimate,
                                  summary.gamma, multipliers),
                    threshold);
  if (num_reductions == 0 ||
      support.size() == part.problem().observations.size()) {
    return;
  }
  for (const std::vector<int64_t>& component :
       SplitIntoComponents(part.problem(), support)) {
    if (IsEnough()) return;
    SolveAndReduce(ProblemSubset(problem_, part.InWhole(component)), whole,
                   threshold, num_reductions - 1);
  }
}

std::vector<int64_t> CertificateSearch::Offer(
    const ProblemSubset& part, double delta,
    const std::vector<Multiplier>& multipliers) {
  if (!(delta > 0) || NumUnknowns(part.problem()) > options_.max_unknowns) {
    return {};
  }
  RepairedMultipliers repaired =
      RepairMultipliers(part.problem(), norm_, delta, multipliers);
  if (!repaired.certificate || !IsBetter(*repaired.certificate, best_)) {
    return repaired.misfits;
  }
  Certificate certificate = InWhole(part, std::move(*repaired.certificate));
  certificate.defect = kMaxDefect;
  const CertificateCheck check = CheckCertificate(problem_, norm_, certificate);
  if (!check.is_accepted) return {};
  certificate.defect =
      std::clamp(kDefectFactor * check.defect, kSmallestDefect, kMaxDefect);
  best_ = std::move(certificate);
  return {};
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
  std::vector<int64_t> previous;
  for (const double threshold : kThresholds) {
    const std::vector<int64_t> support =
        SelectSupport(problem, scores, threshold);
    if (support == previous) continue;
    previous = support;
    for (const std::vector<int64_t>& component :
         SplitIntoComponents(problem, support)) {
      search.Try(component, estimate, multipliers, threshold);
      if (search.IsEnough()) return search.best();
    }
  }
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

}  // namespace krot
