#include "krot/sweeps/momentum.h"

#include "krot/problem/cost.h"

namespace krot {
namespace {

// How often an extrapolation that leaves the positive depths is halved.
constexpr int kMaxHalvings = 4;

void Extrapolate(const std::vector<Eigen::Vector3d>& from,
                 const std::vector<Eigen::Vector3d>& to, double beta,
                 std::vector<Eigen::Vector3d>* result) {
  result->resize(to.size());
  for (size_t k = 0; k < to.size(); ++k) {
    (*result)[k] = to[k] + beta * (to[k] - from[k]);
  }
}

}  // namespace

Momentum::Momentum(const KnownRotationProblem& problem, const Context& context,
                   const Estimate& start, double cost)
    : problem_(problem),
      context_(context),
      best_(start),
      previous_(start),
      best_cost_(cost) {}

Estimate Momentum::NextStart() {
  if (improvements_ == 0) return best_;
  double beta = improvements_ / (improvements_ + 3.0);
  Estimate start;
  for (int halving = 0; halving < kMaxHalvings; ++halving, beta /= 2) {
    Extrapolate(previous_.points, best_.points, beta, &start.points);
    Extrapolate(previous_.translations, best_.translations, beta,
                &start.translations);
    if (context_.All(
            AllDepthsPositive(problem_, start, context_.num_threads))) {
      return start;
    }
  }
  improvements_ = 0;
  return best_;
}

void Momentum::Accept(const Estimate& reached, double cost) {
  const bool improves = cost < best_cost_;
  improvements_ = improves ? improvements_ + 1 : 0;
  if (!improves && cost != best_cost_) return;
  previous_ = std::move(best_);
  best_ = reached;
  best_cost_ = cost;
}

}  // namespace krot
