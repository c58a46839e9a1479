#include "krot/proof/certificate.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "krot/base/check.h"
#include "krot/problem/subset.h"
#include "krot/proof/dual_repair.h"

namespace krot::internal {
namespace {

// Tolerances of SelectBalanced. A strict one drops observations that a proof
// may need; a lax one keeps observations that are far from stationary.
constexpr double kBalanceTolerances[] = {1e-3, 1e-2, 3e-2, 1e-1, 3e-1};
// At most this often misfits are dropped and the rest is tried again. Each try
// costs a repair.
constexpr int kMaxDrops = 20;
// Shares of SelectForFrames in TryAll. A smaller share makes a larger
// certificate; with a larger one, the rest may have to change too much. TryAll
// does not drop misfits: if there are some, the rest proves next to nothing,
// and more iterations are cheaper (docs/history/scale.md).
constexpr double kSparedShares[] = {1e-2, 0};
// Relative gap to which sub-problems are solved. Their bound falls short by as
// much, so it is far below any gap that users ask for.
constexpr double kSmallestGap = 1e-9;
constexpr int kMaxIterations = 100;
// The solve of a sub-problem with more unknowns is given up as soon as its
// optimum turns out to be below the sufficient bound.
constexpr int64_t kLargeUnknowns = 1500;
// Bounds that differ by less than this, relative, count as equal. It is far
// below any gap.
constexpr double kEqualBounds = 1e-7;
// At most this often a sub-problem is reduced to what sets its maximum.
constexpr int kMaxReductions = 4;
// A certificate states a larger defect than was found here, because the
// arithmetic of another machine may find a slightly larger one.
constexpr double kDefectFactor = 2;
constexpr double kSmallestDefect = 1e-12;

std::vector<Multiplier> Pick(const std::vector<Multiplier>& multipliers,
                             const std::vector<int64_t>& observations) {
  std::vector<Multiplier> picked;
  for (const int64_t i : observations) picked.push_back(multipliers[i]);
  return picked;
}

// Of equal bounds, the one with the smaller support is better.
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
    // The optimum is at most the cost of any iterate.
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

// Shares of SelectLarge: multipliers below this, relative to the largest, are
// left out. A smaller support is easier to repair, but may lack an observation
// that the bound needs.
constexpr double kSharesOfLargest[] = {1e-3, 1e-5, 0};
// The same for the tries after those with supports by scores.
constexpr double kSharesBesideScores[] = {1e-3, 1e-5};
// Thresholds of SelectSupport, the cheapest first. A strict one gives a small
// support, which may lack an observation that the bound needs. Multipliers that
// matter span eight decades.
constexpr double kThresholds[] = {1e2, 1, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6};
// Observations with a score above this certainly set the maximum, or nearly so.
// If these have many unknowns, parts are not solved: that takes as long as a
// repair of all multipliers, and proves less.
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

// Whether the observations that certainly set the maximum have many unknowns.
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
  // Scores do not show observations whose depth vanishes at the optimum, so
  // those with large multipliers are tried, too.
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
