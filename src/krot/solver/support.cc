#include "krot/solver/support.h"

#include <algorithm>
#include <limits>

#include "krot/problem/cost.h"
#include "krot/problem/restrict.h"

namespace krot {

std::vector<double> SupportScores(const KnownRotationProblem& problem,
                                  Norm norm, const Estimate& estimate,
                                  double gamma,
                                  const std::vector<Multiplier>& multipliers) {
  std::vector<double> scores(problem.observations.size());
  double sum = 0;
  for (size_t i = 0; i < scores.size(); ++i) {
    const ViewedPoint viewed =
        ViewPoint(problem, problem.observations[i], estimate);
    const double share = multipliers[i].lambda * viewed.depth;
    const double slack = 1 - ResidualOf(viewed, norm) / gamma;
    scores[i] = share / std::max(slack, std::numeric_limits<double>::epsilon());
    sum += share;
  }
  for (double& score : scores) score /= sum;
  return scores;
}

std::vector<int64_t> SelectSupport(const KnownRotationProblem& problem,
                                   const std::vector<double>& scores,
                                   double threshold) {
  std::vector<int64_t> support;
  for (size_t i = 0; i < scores.size(); ++i) {
    if (scores[i] > threshold) support.push_back(static_cast<int64_t>(i));
  }
  return PruneUnconstrained(problem, support);
}

}  // namespace krot
