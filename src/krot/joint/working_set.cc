#include "krot/joint/working_set.h"

#include <algorithm>
#include <functional>
#include <limits>
#include <utility>

#include "krot/joint/frame_ties.h"
#include "krot/problem/cost.h"

namespace krot {
namespace {

constexpr double kShareOfCost = 0.8;
constexpr int kTiesPerFrame = 20;

using Candidate = std::pair<double, int64_t>;  // -cost, point

void KeepWorst(int64_t count, std::vector<Candidate>* candidates) {
  if (static_cast<int64_t>(candidates->size()) <= count) return;
  std::nth_element(candidates->begin(), candidates->begin() + count,
                   candidates->end());
  candidates->resize(count);
}

}  // namespace

WorkingSet::WorkingSet(const KnownRotationProblem& problem,
                       const Context& context)
    : problem_(problem),
      context_(context),
      contains_(problem.num_points, 0),
      num_points_of_whole_(context.Sum(problem.num_points)) {
  if (context.ranks != nullptr) {
    first_point_ = context.ranks->SumBefore(problem.num_points);
  }
}

int64_t WorkingSet::AddAbove(const Estimate& estimate, Norm norm, double level,
                             int64_t max_points) {
  std::vector<Candidate> above;
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    if (Contains(k)) continue;
    const double cost = PointCost(problem_, estimate, norm, k);
    if (cost > level) above.emplace_back(-cost, first_point_ + k);
  }
  KeepWorst(max_points, &above);
  if (context_.ranks != nullptr) {
    above = context_.ranks->Gather(above);
    KeepWorst(max_points, &above);
  }
  for (const Candidate& worst : above) {
    const int64_t k = worst.second - first_point_;
    if (k >= 0 && k < problem_.num_points) contains_[k] = 1;
  }
  num_points_ += static_cast<int64_t>(above.size());
  return static_cast<int64_t>(above.size());
}

void WorkingSet::AddTies(int count) {
  std::vector<int64_t> tied(problem_.num_frames, 0);
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    if (!Contains(k)) continue;
    for (int64_t i = problem_.point_begin[k]; i < problem_.point_begin[k + 1];
         ++i) {
      ++tied[problem_.views[problem_.observations[i].view].frame];
    }
  }
  context_.Reduce(std::plus<int64_t>(), &tied);
  std::vector<int32_t> others;
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    if (!Contains(k)) others.push_back(k);
  }
  const std::vector<int32_t> ties =
      FindTies(problem_, std::move(others), count, std::move(tied), context_);
  for (const int32_t k : ties) contains_[k] = 1;
  num_points_ += context_.Sum(static_cast<int64_t>(ties.size()));
}

void WorkingSet::AddPoint(int32_t point) {
  if (Contains(point)) return;
  contains_[point] = 1;
  ++num_points_;
}

void WorkingSet::AddAll() {
  std::fill(contains_.begin(), contains_.end(), 1);
  num_points_ = num_points_of_whole_;
}

std::vector<int32_t> WorkingSet::Points() const {
  std::vector<int32_t> points;
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    if (Contains(k)) points.push_back(k);
  }
  return points;
}

std::vector<int64_t> WorkingSet::Observations() const {
  std::vector<int64_t> observations;
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    if (!Contains(k)) continue;
    for (int64_t i = problem_.point_begin[k]; i < problem_.point_begin[k + 1];
         ++i) {
      observations.push_back(i);
    }
  }
  return observations;
}

double WorkingSet::Cost(const Estimate& estimate, Norm norm) const {
  double cost = 0;
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    if (!Contains(k)) continue;
    cost = std::max(cost, PointCost(problem_, estimate, norm, k));
  }
  return context_.Max(cost);
}

WorkingSet FirstWorkingSet(const KnownRotationProblem& problem,
                           const Estimate& estimate, Norm norm, double cost,
                           const Context& context) {
  WorkingSet set(problem, context);
  set.AddAbove(estimate, norm, kShareOfCost * cost,
               std::numeric_limits<int64_t>::max());
  set.AddTies(kTiesPerFrame);
  return set;
}

}  // namespace krot
