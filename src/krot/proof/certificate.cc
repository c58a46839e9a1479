#include "krot/proof/certificate.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "krot/base/check.h"
#include "krot/problem/subset.h"
#include "krot/proof/dual_repair.h"

namespace krot::internal {
namespace {

// Of SelectBalanced. A strict one drops observations that a proof may need, a
// lax one keeps what does not balance. Tried on models with outliers together,
// never one by one.
constexpr double kBalanceTolerances[] = {1e-3, 1e-2, 3e-2, 1e-1, 3e-1};
// How often misfits are dropped and the rest is tried again, each time at the
// cost of a repair.
constexpr int kMaxDrops = 20;
// What frames can spare: less makes a larger certificate, more may need too
// large changes of what is left. Misfits are not dropped there: with some the
// rest proves next to nothing, and iterations are cheaper (docs/history/
// scale.md).
constexpr double kSparedShares[] = {1e-2, 0};
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

}  // namespace

int64_t NumUnknowns(const KnownRotationProblem& problem) {
  return 3 * (int64_t{problem.num_points} + problem.num_frames - 1);
}

void CertificateSearch::Try(const std::vector<int64_t>& observations,
                            const Estimate& estimate,
                            const std::vector<Multiplier>& multipliers,
                            std::optional<double> threshold_to_solve) {
  const ProblemSubset part(problem_, observations);
  if (NumUnknowns(part.problem()) > options_.max_unknowns) return;
  const std::vector<Multiplier> known = Pick(multipliers, observations);
  const double delta =
      SuggestedBound(part.problem(), part.Restrict(estimate), known);
  Offer(part, delta, known);
  if (!IsEnough()) TryBalanced(delta, multipliers, observations);
  if (!IsEnough() && threshold_to_solve) {
    SolveAndReduce(part, estimate, *threshold_to_solve, kMaxReductions);
  }
}

void CertificateSearch::TryBalanced(double delta,
                                    const std::vector<Multiplier>& multipliers,
                                    const std::vector<int64_t>& candidates) {
  for (const double tolerance : kBalanceTolerances) {
    std::vector<int64_t> left = candidates;
    for (int drop = 0; drop < kMaxDrops && !left.empty() && !IsEnough();
         ++drop) {
      left = OfferComponents(
          SelectBalanced(problem_, delta, multipliers, std::move(left),
                         tolerance),
          multipliers, options_.max_unknowns,
          [&](const ProblemSubset&, const std::vector<Multiplier>&) {
            return delta;
          });
    }
    if (IsEnough()) return;
  }
}

void CertificateSearch::TryAll(const Estimate& estimate,
                               const std::vector<Multiplier>& multipliers) {
  for (const double share : kSparedShares) {
    if (IsEnough()) return;
    OfferComponents(
        SelectForFrames(problem_, multipliers, share), multipliers,
        std::numeric_limits<int64_t>::max(),
        [&](const ProblemSubset& part, const std::vector<Multiplier>& known) {
          return SuggestedBound(part.problem(), part.Restrict(estimate), known);
        });
  }
}

std::vector<int64_t> CertificateSearch::OfferComponents(
    const std::vector<int64_t>& observations,
    const std::vector<Multiplier>& multipliers, int64_t max_unknowns,
    const DeltaOf& delta_of) {
  std::vector<int64_t> left;
  for (const std::vector<int64_t>& component :
       SplitIntoComponents(problem_, observations)) {
    const ProblemSubset part(problem_, component);
    if (NumUnknowns(part.problem()) > max_unknowns) continue;
    const std::vector<Multiplier> known = Pick(multipliers, component);
    const std::vector<int64_t> misfits =
        Offer(part, delta_of(part, known), known);
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
  if (!(delta > 0)) return {};
  RepairOptions options;
  options.num_threads = context_.num_threads;
  if (NumUnknowns(part.problem()) > options_.max_unknowns) {
    options.sufficient_bound = (1 + kEqualBounds) * options_.sufficient_bound;
  }
  RepairedMultipliers repaired =
      RepairMultipliers(part.problem(), norm_, delta, multipliers, options);
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
