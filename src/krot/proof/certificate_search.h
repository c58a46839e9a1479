#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/conic/interior_point.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"
#include "krot/proof/certificate.h"
#include "krot/verify/certificate_check.h"

namespace krot::internal {

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
