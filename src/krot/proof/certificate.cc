#include "krot/proof/certificate.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <utility>

#include "krot/base/check.h"
#include "krot/problem/subset.h"
#include "krot/proof/dual_repair.h"

namespace krot::internal {
namespace {

// Bounds that differ by less than this, relative, count as equal. It is far
// below any gap.
constexpr double kEqualBounds = 1e-7;

// The number of unknowns of a problem, without those of one frame.
int64_t NumUnknowns(const KnownRotationProblem& problem) {
  return 3 * (int64_t{problem.num_points} + problem.num_frames - 1);
}

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

// Looks for certificates and keeps the best one that the check accepts. It
// tries several sets of multipliers:
//
//   Offer           repairs the given ones
//   TryBalanced     repairs only those that are nearly stationary
//   SolveAndReduce  those at the optimum of the observations' own problem; then
//                   of the problem that sets its maximum, and so on
//   TryAll          those of all observations, where too many set the maximum
//
// All of them end in Offer, which keeps the best, and none goes on once
// IsEnough().
class CertificateSearch {
 public:
  CertificateSearch(const KnownRotationProblem& problem, Norm norm,
                    const CertificateOptions& options, const Context& context)
      : problem_(problem), norm_(norm), options_(options), context_(context) {}

  // Tries the multipliers of these observations, which must be connected, as
  // they are; then only those that are nearly stationary. With a threshold (of
  // SelectSupport) it then solves the observations' own problem, starting from
  // `estimate` of the whole, and after that the problem of the observations
  // that set its maximum, and so on, up to four times.
  void Try(const std::vector<int64_t>& observations, const Estimate& estimate,
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
      SolveAndReduce(part, estimate, *threshold_to_solve, /*num_reductions=*/4);
    }
  }

  // Tries the multipliers of all observations, without points that frames can
  // spare (SelectForFrames). A smaller share makes a larger certificate; with a
  // larger one, the rest may have to change too much.
  void TryAll(const Estimate& estimate,
              const std::vector<Multiplier>& multipliers) {
    for (const double share : {1e-2, 0.0}) {
      if (IsEnough()) return;
      OfferComponents(
          SelectForFrames(problem_, multipliers, share), multipliers,
          std::numeric_limits<int64_t>::max(),
          [&](const ProblemSubset& part, const std::vector<Multiplier>& known) {
            return SuggestedBound(part.problem(), part.Restrict(estimate),
                                  known);
          });
    }
  }

  // Tries those of the candidates' multipliers that are nearly stationary at
  // `delta`, pixels (SelectBalanced). A strict tolerance drops observations
  // that a proof may need; a lax one keeps some that are far from stationary.
  void TryBalanced(double delta, const std::vector<Multiplier>& multipliers,
                   const std::vector<int64_t>& candidates) {
    for (const double tolerance : {1e-3, 1e-2, 3e-2, 1e-1, 3e-1}) {
      if (IsEnough()) return;
      OfferComponents(
          SelectBalanced(problem_, delta, multipliers, candidates, tolerance),
          multipliers, options_.max_unknowns,
          [&](const ProblemSubset&, const std::vector<Multiplier>&) {
            return delta;
          });
    }
  }

  bool IsEnough() const {
    return context_.IsCancelled() ||
           best_.lower_bound >= options_.sufficient_bound;
  }

  std::optional<Certificate> best() const {
    if (best_.observations.empty()) return std::nullopt;
    return best_;
  }

 private:
  using DeltaOf = std::function<double(const ProblemSubset& part,
                                       const std::vector<Multiplier>& known)>;

  void SolveAndReduce(const ProblemSubset& part, const Estimate& whole,
                      double threshold, int num_reductions) {
    InteriorPointOptions options;
    options.norm = norm_;
    // The bound falls short by as much: far below any gap that users ask for.
    options.smallest_gap = 1e-9;
    options.max_iterations = 100;
    if (NumUnknowns(part.problem()) > 1500) {
      // A long solve is given up as soon as its optimum, which is at most the
      // cost of any iterate, turns out to be below the sufficient bound.
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

  // Offers each connected component that is not too large.
  void OfferComponents(const std::vector<int64_t>& observations,
                       const std::vector<Multiplier>& multipliers,
                       int64_t max_unknowns, const DeltaOf& delta_of) {
    for (const std::vector<int64_t>& component :
         SplitIntoComponents(problem_, observations)) {
      const ProblemSubset part(problem_, component);
      if (NumUnknowns(part.problem()) > max_unknowns) continue;
      const std::vector<Multiplier> known = Pick(multipliers, component);
      Offer(part, delta_of(part, known), known);
    }
  }

  // Repairs the part's multipliers, and keeps the result if it is the best so
  // far and the check accepts it.
  void Offer(const ProblemSubset& part, double delta,
             const std::vector<Multiplier>& multipliers) {
    if (!(delta > 0)) return;
    RepairOptions options;
    options.num_threads = context_.num_threads;
    if (NumUnknowns(part.problem()) > options_.max_unknowns) {
      options.sufficient_bound = (1 + kEqualBounds) * options_.sufficient_bound;
    }
    std::optional<Certificate> repaired =
        RepairMultipliers(part.problem(), norm_, delta, multipliers, options);
    if (!repaired || !IsBetter(*repaired, best_)) return;
    Certificate certificate = InWhole(part, *std::move(repaired));
    certificate.defect = kMaxDefect;
    const CertificateCheck check =
        CheckCertificate(problem_, norm_, certificate);
    if (!check.is_accepted) return;
    // The arithmetic of another machine may find a slightly larger defect.
    certificate.defect = std::clamp(2 * check.defect, 1e-12, kMaxDefect);
    best_ = std::move(certificate);
  }

  const KnownRotationProblem& problem_;
  const Norm norm_;
  const CertificateOptions options_;
  const Context context_;
  Certificate best_;
};

void CheckInput(const KnownRotationProblem& problem,
                const std::vector<Multiplier>& multipliers,
                const CertificateOptions& options) {
  CheckArgument(multipliers.size() == problem.observations.size(),
                "multipliers.size()", multipliers.size(),
                "the number of observations");
  CheckAtLeast(1, options.max_unknowns, "options.max_unknowns");
}

// Whether the observations that certainly set the maximum, or nearly so, have
// many unknowns. Then parts are not solved: that takes as long as a repair of
// all multipliers, and proves less.
bool IsSpread(const KnownRotationProblem& problem,
              const std::vector<double>& scores) {
  const std::vector<int64_t> support =
      SelectSupport(problem, scores, /*threshold=*/1);
  return NumUnknowns(ProblemSubset(problem, support).problem()) > 5000;
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
    // The cheapest first. A strict threshold gives a small support, which may
    // lack an observation that the bound needs. Multipliers that matter span
    // eight decades.
    for (const double threshold : {1e2, 1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6}) {
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
  for (const double share : {1e-3, 1e-5}) {
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
  // Multipliers below this share of the largest are left out. A smaller support
  // is easier to repair, but may lack an observation that the bound needs.
  for (const double share : {1e-3, 1e-5, 0.0}) {
    search.TryBalanced(bound, multipliers, SelectLarge(multipliers, share));
    if (search.IsEnough()) break;
  }
  return search.best();
}

std::optional<Certificate> RepairCertificate(
    const KnownRotationProblem& problem, Norm norm, const Estimate& estimate,
    const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options, const Context& context) {
  CertificateSearch search(problem, norm, options, context);
  search.TryAll(estimate, multipliers);
  return search.best();
}

Certificate InWhole(const ProblemSubset& part, Certificate certificate) {
  for (CertifiedObservation& o : certificate.observations) {
    o.observation = part.InWhole(o.observation);
  }
  return certificate;
}

}  // namespace krot::internal
