#include "krot/proof/certificate.h"

#include <algorithm>
#include <utility>

#include "krot/base/check.h"
#include "krot/problem/cost.h"
#include "krot/problem/restrict.h"
#include "krot/proof/dual_repair.h"
#include "krot/proof/support.h"

namespace krot {
namespace {

// Of SelectBalanced.
constexpr double kBalanceTolerances[] = {1e-3, 1e-2, 3e-2, 1e-1, 3e-1};
// How often misfits are dropped and the rest is tried again.
constexpr int kMaxDrops = 20;
// Smaller multipliers, by the largest, are left out at first.
constexpr double kSharesOfLargest[] = {1e-3, 1e-5, 0};
constexpr double kSharesBesideScores[] = {1e-3, 1e-5};
constexpr double kThresholds[] = {1e2, 1, 1e-1, 1e-2, 1e-3, 1e-4, 1e-6};
// Of the sub-problems.
constexpr double kSmallestGap = 1e-9;
constexpr int kMaxIterations = 100;
// Larger ones are given up as soon as they cannot prove enough.
constexpr int64_t kLargeUnknowns = 1500;
constexpr double kEqualBounds = 1e-7;  // relative
constexpr int kMaxReductions = 4;
// The defect that a certificate states allows for another machine's
// arithmetic, which may find a little more than was found here.
constexpr double kDefectFactor = 2;
constexpr double kSmallestDefect = 1e-12;

// The bound that multipliers would prove, pixels, if (1) held: the estimate
// times (1).
double SuggestedBound(const KnownRotationProblem& problem,
                      const Estimate& estimate,
                      const std::vector<Multiplier>& multipliers) {
  double weighted_residual = 0;
  double weighted_depth = 0;
  for (size_t i = 0; i < multipliers.size(); ++i) {
    const ViewedPoint viewed =
        ViewPoint(problem, problem.observations[i], estimate);
    weighted_residual -= multipliers[i].y.dot(viewed.v);
    weighted_depth += multipliers[i].lambda * viewed.depth;
  }
  return weighted_residual / weighted_depth;
}

// The observations whose multipliers exceed a share of the largest.
std::vector<int64_t> LargeOnes(const std::vector<Multiplier>& multipliers,
                               double share) {
  double largest = 0;
  for (const Multiplier& m : multipliers) largest = std::max(largest, m.lambda);
  std::vector<int64_t> large;
  for (size_t i = 0; i < multipliers.size(); ++i) {
    if (multipliers[i].lambda > share * largest) {
      large.push_back(static_cast<int64_t>(i));
    }
  }
  return large;
}

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

class Maker {
 public:
  Maker(const KnownRotationProblem& problem, Norm norm,
        const CertificateOptions& options)
      : problem_(problem), norm_(norm), options_(options) {}

  // Tries the multipliers of these observations, connected, as they are; then
  // those of their sub-problem, solved from `estimate` of the whole; then that
  // of what sets its maximum, and so on.
  void Try(const std::vector<int64_t>& observations, const Estimate& estimate,
           const std::vector<Multiplier>& multipliers, double threshold);

  // Tries what balances of these multipliers at `delta`, pixels.
  void TryBalanced(double delta, const std::vector<Multiplier>& multipliers,
                   const std::vector<int64_t>& candidates);

  bool IsEnough() const {
    return IsCancelled(options_.cancel) ||
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
  void SolveAndReduce(const RestrictedProblem& part, const Estimate& whole,
                      double threshold, int num_reductions);
  std::vector<int64_t> OfferBalanced(double delta,
                                     const std::vector<Multiplier>& multipliers,
                                     const std::vector<int64_t>& candidates,
                                     double tolerance);
  // Returns the misfits of the part.
  std::vector<int64_t> Offer(const RestrictedProblem& part, double delta,
                             const std::vector<Multiplier>& multipliers);

  const KnownRotationProblem& problem_;
  const Norm norm_;
  const CertificateOptions& options_;
  Certificate best_;
};

void Maker::Try(const std::vector<int64_t>& observations, const Estimate& whole,
                const std::vector<Multiplier>& multipliers, double threshold) {
  const RestrictedProblem part = RestrictProblem(problem_, observations);
  if (NumUnknowns(part.problem) > options_.max_unknowns) return;
  const std::vector<Multiplier> known = Pick(multipliers, observations);
  const double delta =
      SuggestedBound(part.problem, RestrictEstimate(part, whole), known);
  Offer(part, delta, known);
  if (!IsEnough()) TryBalanced(delta, multipliers, observations);
  if (!IsEnough()) SolveAndReduce(part, whole, threshold, kMaxReductions);
}

void Maker::TryBalanced(double delta,
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
std::vector<int64_t> Maker::OfferBalanced(
    double delta, const std::vector<Multiplier>& multipliers,
    const std::vector<int64_t>& candidates, double tolerance) {
  std::vector<int64_t> left;
  const std::vector<int64_t> balanced =
      SelectBalanced(problem_, delta, multipliers, candidates, tolerance);
  for (const std::vector<int64_t>& component :
       SplitIntoComponents(problem_, balanced)) {
    const std::vector<int64_t> misfits =
        Offer(RestrictProblem(problem_, component), delta,
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

void Maker::SolveAndReduce(const RestrictedProblem& part, const Estimate& whole,
                           double threshold, int num_reductions) {
  InteriorPointOptions options;
  options.norm = norm_;
  options.smallest_gap = kSmallestGap;
  options.max_iterations = kMaxIterations;
  options.num_threads = options_.num_threads;
  options.cancel = options_.cancel;
  if (NumUnknowns(part.problem) > kLargeUnknowns) {
    // Its optimum is below every cost it reaches.
    options.stop = [this](const ConicIterate& iterate) {
      return iterate.cost < options_.sufficient_bound;
    };
  }
  Estimate estimate = RestrictEstimate(part, whole);
  std::vector<Multiplier> multipliers;
  const InteriorPointSummary summary =
      MinimizeJointly(part.problem, options, &estimate, &multipliers);
  if (summary.termination == InteriorPointTermination::kStopped) return;
  Offer(part, SuggestedBound(part.problem, estimate, multipliers), multipliers);

  const std::vector<int64_t> support = SelectSupport(
      part.problem,
      SupportScores(part.problem, norm_, estimate, summary.gamma, multipliers),
      threshold);
  if (num_reductions == 0 ||
      support.size() == part.problem.observations.size()) {
    return;
  }
  for (const std::vector<int64_t>& component :
       SplitIntoComponents(part.problem, support)) {
    if (IsEnough()) return;
    std::vector<int64_t> rest;
    for (const int64_t i : component) rest.push_back(part.observation_of[i]);
    SolveAndReduce(RestrictProblem(problem_, rest), whole, threshold,
                   num_reductions - 1);
  }
}

std::vector<int64_t> Maker::Offer(const RestrictedProblem& part, double delta,
                                  const std::vector<Multiplier>& multipliers) {
  if (!(delta > 0) || NumUnknowns(part.problem) > options_.max_unknowns) {
    return {};
  }
  RepairedMultipliers repaired =
      RepairMultipliers(part.problem, norm_, delta, multipliers);
  std::optional<Certificate>& certificate = repaired.certificate;
  if (!certificate || !IsBetter(*certificate, best_)) return repaired.misfits;
  for (CertifiedObservation& o : certificate->observations) {
    o.observation = part.observation_of[o.observation];
  }
  certificate->defect = kMaxDefect;
  const CertificateCheck check =
      CheckCertificate(problem_, norm_, *certificate);
  if (!check.is_accepted) return {};
  certificate->defect =
      std::clamp(kDefectFactor * check.defect, kSmallestDefect, kMaxDefect);
  best_ = std::move(*certificate);
  return {};
}

}  // namespace

std::optional<Certificate> MakeCertificate(
    const KnownRotationProblem& problem, Norm norm, const Estimate& estimate,
    double gamma, const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options) {
  CheckInput(problem, multipliers, options);
  const std::vector<double> scores =
      SupportScores(problem, norm, estimate, gamma, multipliers);
  Maker maker(problem, norm, options);
  std::vector<int64_t> previous;
  for (const double threshold : kThresholds) {
    const std::vector<int64_t> support =
        SelectSupport(problem, scores, threshold);
    if (support == previous) continue;
    previous = support;
    for (const std::vector<int64_t>& component :
         SplitIntoComponents(problem, support)) {
      maker.Try(component, estimate, multipliers, threshold);
      if (maker.IsEnough()) return maker.best();
    }
  }
  // Scores do not tell an observation whose depth vanishes at the optimum.
  const double delta = SuggestedBound(problem, estimate, multipliers);
  for (const double share : kSharesBesideScores) {
    maker.TryBalanced(delta, multipliers, LargeOnes(multipliers, share));
    if (maker.IsEnough()) break;
  }
  return maker.best();
}

std::optional<Certificate> MakeInfeasibilityCertificate(
    const KnownRotationProblem& problem, Norm norm, double bound,
    const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options) {
  CheckInput(problem, multipliers, options);
  Maker maker(problem, norm, options);
  for (const double share : kSharesOfLargest) {
    maker.TryBalanced(bound, multipliers, LargeOnes(multipliers, share));
    if (maker.IsEnough()) break;
  }
  return maker.best();
}

}  // namespace krot
