#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/conic/interior_point.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

// How much observation i looks like one that sets the maximum gamma:
//
//   (lambda_i w_i / sum_j lambda_j w_j) / (1 - r_i / gamma).
//
// Multipliers alone span many decades among observations that matter; on the
// central path the product of numerator and denominator is the same for all,
// so the quotient separates them.
std::vector<double> SupportScores(const KnownRotationProblem& problem,
                                  Norm norm, const Estimate& estimate,
                                  double gamma,
                                  const std::vector<Multiplier>& multipliers);

// The observations whose score exceeds `threshold`, without those that bound
// nothing (PruneUnconstrained). Ascending.
std::vector<int64_t> SelectSupport(const KnownRotationProblem& problem,
                                   const std::vector<double>& scores,
                                   double threshold);

// The observations whose lambda exceeds `share` of the largest.
std::vector<int64_t> SelectLarge(const std::vector<Multiplier>& multipliers,
                                 double share);

// All observations of the points that are left when points leave, those with
// the smallest lambdas first, where no frame that moves loses more than `share`
// of its own. What balances with all of them nearly does with these.
std::vector<int64_t> SelectForFrames(const KnownRotationProblem& problem,
                                     const std::vector<Multiplier>& multipliers,
                                     double share);

// The largest part of the `candidates`, ascending, in which the forces of the
// multipliers at `delta` pixels (force_checker.h) balance at every point and
// frame that is not fixed, up to `tolerance` > 0 of the largest delta lambda
// there: what does not is dropped, until everything does, and without those
// that bound nothing.
std::vector<int64_t> SelectBalanced(const KnownRotationProblem& problem,
                                    double delta,
                                    const std::vector<Multiplier>& multipliers,
                                    std::vector<int64_t> candidates,
                                    double tolerance);

// The bound that multipliers would prove, pixels, if (1) of certificate_check.h
// held: the estimate times (1).
double SuggestedBound(const KnownRotationProblem& problem,
                      const Estimate& estimate,
                      const std::vector<Multiplier>& multipliers);

struct CertificateOptions {
  // The first certificate that proves as much will do, pixels.
  double sufficient_bound = std::numeric_limits<double>::infinity();
  // Supports with more unknowns are not tried; >= 1.
  int max_unknowns = 15000;
};

// A lower bound on every estimate's cost with its proof, from an interior
// point's iterate: positive depths, residuals below gamma, one multiplier per
// observation. Their sum need not prove anything; they only tell which
// observations may set the maximum.
//
// For several thresholds of SupportScores it repairs the multipliers of the
// observations above (of each of their connected components, as each is a
// bound), then those that balance of them (SelectBalanced), then those of
// their own sub-problem, solved, without what does not set its maximum. It
// keeps the highest bound that CheckCertificate accepts. None if there is no
// such. p = 1, 2 or infinity. Allocates as much as a few sub-problems.
std::optional<Certificate> MakeCertificate(
    const KnownRotationProblem& problem, Norm norm, const Estimate& estimate,
    double gamma, const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options, const Context& context);

// The same from the multipliers with which FindFeasible ends where no estimate
// has all its residuals below `bound`, pixels: a certificate near that bound
// from what balances of them (SelectBalanced), for several tolerances.
std::optional<Certificate> MakeInfeasibilityCertificate(
    const KnownRotationProblem& problem, Norm norm, double bound,
    const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options, const Context& context);

// A part's certificate as one of the whole.
Certificate InWhole(const ProblemSubset& part, Certificate certificate);

// Looks for certificates among given observations, connected, and keeps the
// best that the check accepts:
//
//   as they are   repairs the multipliers in hand               Offer
//   balanced      of those, what balances, without misfits      TryBalanced
//   solved        those of the sub-problem's own optimum, then  SolveAndReduce
//                 of what sets the maximum of that, and so on
//   all           of all observations, where what sets the      TryAll
//                 maximum is too much to be found
//
// Every way ends in Offer, which alone writes the best, and none goes on once
// IsEnough().
class CertificateSearch {
 public:
  CertificateSearch(const KnownRotationProblem& problem, Norm norm,
                    const CertificateOptions& options, const Context& context)
      : problem_(problem), norm_(norm), options_(options), context_(context) {}

  // Tries the multipliers of these observations, connected, as they are; then
  // what balances of them. With a threshold of SelectSupport, then those of
  // their sub-problem, solved from `estimate` of the whole; then that of what
  // sets its maximum, and so on.
  void Try(const std::vector<int64_t>& observations, const Estimate& estimate,
           const std::vector<Multiplier>& multipliers,
           std::optional<double> threshold_to_solve);

  // Tries the multipliers of all observations at once, but for what the frames
  // can spare.
  void TryAll(const Estimate& estimate,
              const std::vector<Multiplier>& multipliers);

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
  using DeltaOf = std::function<double(const ProblemSubset& part,
                                       const std::vector<Multiplier>& known)>;

  void SolveAndReduce(const ProblemSubset& part, const Estimate& whole,
                      double threshold, int num_reductions);
  // Offers each connected component that is not too large; returns the
  // observations of those that are worth another try, without their misfits.
  std::vector<int64_t> OfferComponents(
      const std::vector<int64_t>& observations,
      const std::vector<Multiplier>& multipliers, int64_t max_unknowns,
      const DeltaOf& delta_of);
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

// Of the problem.
int64_t NumUnknowns(const KnownRotationProblem& problem);

}  // namespace krot::internal
