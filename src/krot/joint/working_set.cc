#include "krot/joint/working_set.h"

#include <algorithm>
#include <utility>

#include "krot/problem/cost.h"

namespace krot {
namespace {

constexpr double kShareOfCost = 0.8;
constexpr int kTiesPerFrame = 20;

}  // namespace

WorkingSet::WorkingSet(const KnownRotationProblem& problem)
    : problem_(problem), contains_(problem.num_points, 0) {}

void WorkingSet::Add(int32_t point) {
  contains_[point] = 1;
  ++num_points_;
}

int64_t WorkingSet::AddAbove(const Estimate& estimate, Norm norm, double level,
                             int64_t max_points) {
  std::vector<std::pair<double, int32_t>> above;  // -cost, point
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    if (Contains(k)) continue;
    const double cost = PointCost(problem_, estimate, norm, k);
    if (cost > level) above.emplace_back(-cost, k);
  }
  if (static_cast<int64_t>(above.size()) > max_points) {
    std::nth_element(above.begin(), above.begin() + max_points, above.end());
    above.resize(max_points);
  }
  for (const auto& worst : above) Add(worst.second);
  return static_cast<int64_t>(above.size());
}

void WorkingSet::AddTies(int count) {
  std::vector<int64_t> missing(problem_.num_frames, count);  // per frame
  const auto for_frames = [&](int32_t point, const auto& visit) {
    for (int64_t i = problem_.point_begin[point];
         i < problem_.point_begin[point + 1]; ++i) {
      visit(missing[problem_.views[problem_.observations[i].view].frame]);
    }
  };
  std::vector<int32_t> others;
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    if (Contains(k)) {
      for_frames(k, [](int64_t& left) { --left; });
    } else {
      others.push_back(k);
    }
  }
  const auto length = [&](int32_t k) {
    return problem_.point_begin[k + 1] - problem_.point_begin[k];
  };
  std::stable_sort(others.begin(), others.end(),
                   [&](int32_t a, int32_t b) { return length(a) > length(b); });
  for (const int32_t k : others) {
    bool is_missed = false;
    for_frames(k, [&](int64_t& left) { is_missed |= left > 0; });
    if (!is_missed) continue;
    for_frames(k, [](int64_t& left) { --left; });
    Add(k);
  }
}

void WorkingSet::AddPoint(int32_t point) {
  if (!Contains(point)) Add(point);
}

void WorkingSet::AddAll() {
  std::fill(contains_.begin(), contains_.end(), 1);
  num_points_ = problem_.num_points;
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
  return cost;
}

WorkingSet FirstWorkingSet(const KnownRotationProblem& problem,
                           const Estimate& estimate, Norm norm, double cost) {
  WorkingSet set(problem);
  set.AddAbove(estimate, norm, kShareOfCost * cost, problem.num_points);
  set.AddTies(kTiesPerFrame);
  return set;
}

}  // namespace krot
