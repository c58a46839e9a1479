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

// Scores that are large for observations that set the maximum gamma:
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

// The observations whose score exceeds `threshold`, without those that
// contribute nothing to a bound (PruneUnconstrained). Ascending.
std::vector<int64_t> SelectSupport(const KnownRotationProblem& problem,
                                   const std::vector<double>& scores,
                                   double threshold);

// The observations whose lambda exceeds `share` of the largest.
std::vector<int64_t> SelectLarge(const std::vector<Multiplier>& multipliers,
                                 double share);

// Drops points, those with the smallest sums of lambda first, as long as no
// frame that is not fixed loses more than `share` of its own sum of lambda.
// Returns all observations of the points that are left. If (1) of
// certificate_check.h nearly holds for all observations, it still nearly does.
std::vector<int64_t> SelectForFrames(const KnownRotationProblem& problem,
                                     const std::vector<Multiplier>& multipliers,
                                     double share);

// The largest subset of the `candidates`, ascending, for which the dual
// residual at every point and frame that is not fixed (the sum of gradients,
// force_checker.h, at `delta` pixels) is below `tolerance` > 0 times the
// largest delta lambda there. Observations at other points and frames, and
// those that contribute nothing to a bound, are dropped until none is left.
std::vector<int64_t> SelectBalanced(const KnownRotationProblem& problem,
                                    double delta,
                                    const std::vector<Multiplier>& multipliers,
                                    std::vector<int64_t> candidates,
                                    double tolerance);

// The bound that multipliers would prove, pixels, if (1) of certificate_check.h
// held. It follows from multiplying (1) by the estimate.
double SuggestedBound(const KnownRotationProblem& problem,
                      const Estimate& estimate,
                      const std::vector<Multiplier>& multipliers);

struct CertificateOptions {
  // The search ends with the first certificate that proves this bound, pixels.
  double sufficient_bound = std::numeric_limits<double>::infinity();
  // Supports with more unknowns are not tried; >= 1.
  int max_unknowns = 15000;
};

// A lower bound on every estimate's cost with its proof, made from an interior
// point's iterate: positive depths, residuals below gamma, one multiplier per
// observation. The multipliers need not prove anything by themselves; they show
// which observations may set the maximum.
//
// For several thresholds of SupportScores it takes the observations above, and
// each of their connected components by itself, as each gives a bound. It
// repairs their multipliers; then only those that are nearly stationary
// (SelectBalanced); then those of a solve of the sub-problem, which is reduced
// to what sets its maximum. It keeps the highest bound that CheckCertificate
// accepts; none if there is none. p = 1, 2 or infinity. Allocates as much as a
// few sub-problems.
std::optional<Certificate> MakeCertificate(
    const KnownRotationProblem& problem, Norm norm, const Estimate& estimate,
    double gamma, const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options, const Context& context);

// The same from the multipliers with which FindFeasible ends if no estimate has
// all its residuals below `bound`, pixels. The certificate's bound is near
// `bound`; it is made of multipliers that are nearly stationary
// (SelectBalanced), for several tolerances.
std::optional<Certificate> MakeInfeasibilityCertificate(
    const KnownRotationProblem& problem, Norm norm, double bound,
    const std::vector<Multiplier>& multipliers,
    const CertificateOptions& options, const Context& context);

// A certificate of a part, with the observation indices of the whole problem.
Certificate InWhole(const ProblemSubset& part, Certificate certificate);

// Looks for certificates and keeps the best one that the check accepts. It
// tries several sets of multipliers:
//
//   Offer           repairs the given ones
//   TryBalanced     repairs only those that are nearly stationary, without
//                   misfits
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
  // that set its maximum, and so on.
  void Try(const std::vector<int64_t>& observations, const Estimate& estimate,
           const std::vector<Multiplier>& multipliers,
           std::optional<double> threshold_to_solve);

  // Tries the multipliers of all observations, without points that frames can
  // spare (SelectForFrames).
  void TryAll(const Estimate& estimate,
              const std::vector<Multiplier>& multipliers);

  // Tries those of the candidates' multipliers that are nearly stationary at
  // `delta`, pixels (SelectBalanced).
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
  // Offers each connected component that is not too large. Returns the
  // observations of components that have misfits, without these, as they are
  // worth another try.
  std::vector<int64_t> OfferComponents(
      const std::vector<int64_t>& observations,
      const std::vector<Multiplier>& multipliers, int64_t max_unknowns,
      const DeltaOf& delta_of);
  // Repairs the part's multipliers, and keeps the result if it is the best so
  // far and the check accepts it. Returns the misfits of the part.
  std::vector<int64_t> Offer(const ProblemSubset& part, double delta,
                             const std::vector<Multiplier>& multipliers);

  const KnownRotationProblem& problem_;
  const Norm norm_;
  const CertificateOptions options_;
  const Context context_;
  Certificate best_;
};

// The number of unknowns of a problem, without those of one frame.
int64_t NumUnknowns(const KnownRotationProblem& problem);

}  // namespace krot::internal
