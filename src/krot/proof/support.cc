#include "krot/proof/certificate.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "krot/problem/cost.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// The dual residual at a point or frame, from some of its observations.
struct ForceSum {
  Vector3d sum = Vector3d::Zero();  // of the gradients
  double largest = 0;               // the largest delta lambda

  bool IsWithin(double tolerance) const {
    return sum.norm() < tolerance * largest;
  }
};

struct ForceSums {
  std::vector<ForceSum> of_point;
  std::vector<ForceSum> of_frame;
};

ForceSums BalanceForces(const KnownRotationProblem& problem, double delta,
                        const std::vector<Multiplier>& multipliers,
                        const std::vector<int64_t>& observations) {
  ForceSums balances{std::vector<ForceSum>(problem.num_points),
                     std::vector<ForceSum>(problem.num_frames)};
  for (const int64_t i : observations) {
    const Observation& observation = problem.observations[i];
    const View& view = problem.views[observation.view];
    const double delta_lambda = delta * multipliers[i].lambda;
    const Vector3d force =
        view.cam_from_world_rotation.transpose() *
        (observation.E.transpose() *
         Vector3d(delta_lambda, multipliers[i].y[0], multipliers[i].y[1]));
    for (ForceSum* balance : {&balances.of_point[observation.point],
                              &balances.of_frame[view.frame]}) {
      balance->sum += force;
      balance->largest = std::max(balance->largest, delta_lambda);
    }
  }
  return balances;
}

}  // namespace

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

std::vector<int64_t> SelectLarge(const std::vector<Multiplier>& multipliers,
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

std::vector<int64_t> SelectForFrames(const KnownRotationProblem& problem,
                                     const std::vector<Multiplier>& multipliers,
                                     double share) {
  std::vector<double> of_point(problem.num_points, 0);
  std::vector<double> spare(problem.num_frames, 0);
  for (size_t i = 0; i < multipliers.size(); ++i) {
    of_point[problem.observations[i].point] += multipliers[i].lambda;
    spare[problem.FrameOf(static_cast<int64_t>(i))] +=
        share * multipliers[i].lambda;
  }
  std::vector<int32_t> lightest(problem.num_points);
  std::iota(lightest.begin(), lightest.end(), 0);
  std::stable_sort(lightest.begin(), lightest.end(), [&](int32_t a, int32_t b) {
    return of_point[a] < of_point[b];
  });
  std::vector<char> is_left(problem.num_points, 0);
  for (const int32_t k : lightest) {
    bool can_leave = true;
    int64_t i = problem.point_begin[k];
    for (; i < problem.point_begin[k + 1] && can_leave; ++i) {
      double& left = spare[problem.FrameOf(i)];
      left -= multipliers[i].lambda;
      can_leave = left >= 0 || problem.IsFixedFrame(problem.FrameOf(i));
    }
    if (can_leave) continue;
    is_left[k] = 1;
    while (--i >= problem.point_begin[k]) {
      spare[problem.FrameOf(i)] += multipliers[i].lambda;
    }
  }
  std::vector<int64_t> selected;
  for (size_t i = 0; i < multipliers.size(); ++i) {
    if (is_left[problem.observations[i].point]) {
      selected.push_back(static_cast<int64_t>(i));
    }
  }
  return selected;
}

std::vector<int64_t> SelectBalanced(const KnownRotationProblem& problem,
                                    double delta,
                                    const std::vector<Multiplier>& multipliers,
                                    std::vector<int64_t> candidates,
                                    double tolerance) {
  for (;;) {
    const ForceSums balances =
        BalanceForces(problem, delta, multipliers, candidates);
    std::vector<int64_t> balanced;
    for (const int64_t i : candidates) {
      const Observation& observation = problem.observations[i];
      const int32_t frame = problem.views[observation.view].frame;
      if ((problem.IsFixedPoint(observation.point) ||
           balances.of_point[observation.point].IsWithin(tolerance)) &&
          (problem.IsFixedFrame(frame) ||
           balances.of_frame[frame].IsWithin(tolerance))) {
        balanced.push_back(i);
      }
    }
    balanced = PruneUnconstrained(problem, balanced);
    if (balanced.size() == candidates.size()) return balanced;
    candidates = std::move(balanced);
  }
}

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

}  // namespace krot::internal
