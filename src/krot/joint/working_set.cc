#include "krot/joint/working_set.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <utility>

#include "krot/base/parallel_for.h"
#include "krot/problem/cost.h"
#include "krot/sweeps/res_int.h"

namespace krot::internal {
namespace {

// The first working set has the points with a residual above this share of the
// cost.
constexpr double kShareOfCost = 0.9;
constexpr int kTiesPerFrame = 20;
// The usual ShareOfLevel.
constexpr double kNearShare = 0.7;
// Baselines below this, relative to the median depth, are tiny.
constexpr double kTinyBaseline = 1e-3;
// AddAbove takes at least this many observations of a point. With fewer, the
// point's other observations soon exceed the level.
constexpr size_t kLeastPerPoint = 4;
constexpr int64_t kPointsPerChunk = 1024;

// A residual with changed sign, so that sorting puts the worst first, and the
// index of its point or observation.
using Candidate = std::pair<double, int64_t>;

// The median depth, rounded down to a power of two. Ranks can add up counts of
// depths per power of two; the median itself would need all depths.
double CoarseMedianDepth(const KnownRotationProblem& problem,
                         const Estimate& estimate, const Context& context) {
  constexpr int kLowest = std::numeric_limits<double>::min_exponent - 1;
  std::vector<int64_t> count(
      std::numeric_limits<double>::max_exponent - kLowest, 0);
  for (const Observation& observation : problem.observations) {
    const double depth = ViewPoint(problem, observation, estimate).depth;
    if (std::isnormal(depth) && depth > 0) ++count[std::ilogb(depth) - kLowest];
  }
  ReduceRanks(context, std::plus<int64_t>(), &count);
  int64_t left = std::accumulate(count.begin(), count.end(), int64_t{0}) / 2;
  size_t n = 0;
  while (n + 1 < count.size() && left >= count[n]) left -= count[n++];
  return std::ldexp(1.0, static_cast<int>(n) + kLowest);
}

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
      takes_(problem.observations.size(), 0),
      num_observations_of_whole_(SumOfRanks(
          context, static_cast<int64_t>(problem.observations.size()))) {
  if (context.ranks != nullptr) {
    first_point_ = context.ranks->SumBefore(problem.num_points);
  }
}

void WorkingSet::Take(int64_t observation) {
  char& takes = takes_[observation];
  num_observations_here_ += 1 - takes;
  takes = 1;
  char& contains = contains_[problem_.observations[observation].point];
  num_points_here_ += 1 - contains;
  contains = 1;
}

void WorkingSet::CountTaken() {
  num_points_ = SumOfRanks(context_, num_points_here_);
  num_observations_ = SumOfRanks(context_, num_observations_here_);
}

// The largest residual of the point's observations outside of the set; 0 if
// there are none.
double WorkingSet::LargestOutside(const std::vector<AffineMap>& cameras,
                                  const Estimate& estimate, Norm norm,
                                  int32_t k) const {
  double largest = 0;
  for (int64_t i = problem_.point_begin[k]; i < problem_.point_begin[k + 1];
       ++i) {
    if (takes_[i] != 0) continue;
    const Observation& o = problem_.observations[i];
    largest = std::max(
        largest,
        ResidualOf(ViewPoint(cameras[o.view], o, estimate.points[k]), norm));
  }
  return largest;
}

int64_t WorkingSet::AddAbove(const Estimate& estimate, Norm norm, double level,
                             int64_t max_points, double share) {
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem_, estimate.translations);
  std::vector<double> outside(problem_.num_points);
  ParallelFor(problem_.num_points, kPointsPerChunk, context_.num_threads,
              [&](int64_t begin, int64_t end, int) {
                for (int64_t k = begin; k < end; ++k) {
                  outside[k] = LargestOutside(cameras, estimate, norm,
                                              static_cast<int32_t>(k));
                }
              });
  std::vector<Candidate> above;
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    if (outside[k] > level) above.emplace_back(-outside[k], first_point_ + k);
  }
  KeepWorst(max_points, &above);
  if (context_.ranks != nullptr) {
    above = context_.ranks->Gather(above);
    KeepWorst(max_points, &above);
  }
  std::vector<Candidate> residuals;  // of a point
  for (const Candidate& worst : above) {
    const int64_t k = worst.second - first_point_;
    if (k < 0 || k >= problem_.num_points) continue;
    residuals.clear();
    for (int64_t i = problem_.point_begin[k]; i < problem_.point_begin[k + 1];
         ++i) {
      const Observation& o = problem_.observations[i];
      residuals.emplace_back(
          -ResidualOf(ViewPoint(cameras[o.view], o, estimate.points[k]), norm),
          i);
    }
    std::sort(residuals.begin(), residuals.end());
    for (size_t n = 0; n < residuals.size(); ++n) {
      if (n >= kLeastPerPoint && -residuals[n].first < share * level) break;
      Take(residuals[n].second);
    }
  }
  CountTaken();
  return static_cast<int64_t>(above.size());
}

void WorkingSet::AddTies(int count) {
  std::vector<int64_t> tied(problem_.num_frames, 0);
  for (const int64_t i : Observations()) {
    ++tied[problem_.views[problem_.observations[i].view].frame];
  }
  ReduceRanks(context_, std::plus<int64_t>(), &tied);
  std::vector<int32_t> others;
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    const auto begin = takes_.begin() + problem_.point_begin[k];
    const auto end = takes_.begin() + problem_.point_begin[k + 1];
    if (std::find(begin, end, 0) != end) others.push_back(k);
  }
  const std::vector<int32_t> ties =
      FindTies(problem_, std::move(others), count, std::move(tied), context_);
  for (const int32_t k : ties) TakePoint(k);
  CountTaken();
}

void WorkingSet::TakePoint(int32_t point) {
  for (int64_t i = problem_.point_begin[point];
       i < problem_.point_begin[point + 1]; ++i) {
    Take(i);
  }
}

void WorkingSet::AddPoint(int32_t point) {
  TakePoint(point);
  CountTaken();
}

void WorkingSet::AddAll() {
  for (size_t i = 0; i < takes_.size(); ++i) Take(static_cast<int64_t>(i));
  CountTaken();
}

std::vector<int64_t> WorkingSet::Observations() const {
  std::vector<int64_t> observations;
  observations.reserve(num_observations_here_);
  for (size_t i = 0; i < takes_.size(); ++i) {
    if (takes_[i] != 0) observations.push_back(static_cast<int64_t>(i));
  }
  return observations;
}

double WorkingSet::Cost(const Estimate& estimate, Norm norm) const {
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem_, estimate.translations);
  double cost = 0;
  for (size_t i = 0; i < takes_.size(); ++i) {
    if (takes_[i] == 0) continue;
    const Observation& o = problem_.observations[i];
    cost = std::max(cost, ResidualOf(ViewPoint(cameras[o.view], o,
                                               estimate.points[o.point]),
                                     norm));
  }
  return MaxOfRanks(context_, cost);
}

double ShareOfLevel(const KnownRotationProblem& problem,
                    const Estimate& estimate, const Context& context) {
  if (!HasBaseline(problem)) return kNearShare;
  double longest = 0;
  for (const View& view : problem.views) {
    longest = std::max(longest, view.cam_from_rig_translation.norm());
  }
  const bool is_tiny =
      longest < kTinyBaseline * CoarseMedianDepth(problem, estimate, context);
  return is_tiny ? 0 : kNearShare;
}

WorkingSet FirstWorkingSet(const KnownRotationProblem& problem,
                           const Estimate& estimate, Norm norm, double cost,
                           const Context& context) {
  WorkingSet set(problem, context);
  set.AddAbove(estimate, norm, kShareOfCost * cost,
               std::numeric_limits<int64_t>::max(),
               ShareOfLevel(problem, estimate, context));
  set.AddTies(kTiesPerFrame);
  return set;
}

namespace {

// PlacePoints stops moving a point below this share of the level. It is less
// than the share above which a working set takes points in
// (component_solve.cc).
constexpr double kSufficientShareOfLevel = 0.7;
// The sweeps of ExtendSolution solve blocks above kShareOfHighest of the
// highest cost allowed, to kSweepTolerance, relative. They end if a sweep
// leaves more than kExcessLeft of the excess over the highest cost.
constexpr double kShareOfHighest = 0.9;
constexpr double kSweepTolerance = 1e-3;
constexpr double kExcessLeft = 0.8;
constexpr int kMaxSweeps = 10;

}  // namespace

bool PlacePoints(const KnownRotationProblem& problem, Norm norm,
                 const Context& context, double level, Estimate* estimate) {
  BlockSweep blocks(problem, FastDescentOptions(), norm, context);
  DescentGoal goal;
  goal.level = level;
  goal.sufficient = kSufficientShareOfLevel * level;
  blocks.SetGoal(goal);
  return std::isfinite(blocks.IntersectPoints(estimate));
}

bool ExtendSolution(const KnownRotationProblem& problem, Norm norm,
                    const Context& context, double level, double highest,
                    Estimate* estimate) {
  if (!PlacePoints(problem, norm, context, level, estimate)) return false;
  const auto excess = [&] {
    return MaxOfRanks(context,
                      Cost(problem, *estimate, norm, context.num_threads)) -
           highest;
  };
  double left = excess();
  if (left <= 0) return true;
  BlockSweep blocks(problem, FastDescentOptions(), norm, context);
  blocks.SetGoal({kSweepTolerance, kShareOfHighest * highest});
  for (int sweep = 0; sweep < kMaxSweeps; ++sweep) {
    blocks.ResectFrames(estimate);
    blocks.IntersectPoints(estimate);
    const double before = std::exchange(left, excess());
    if (left <= 0) return true;
    if (left > kExcessLeft * before) return false;
  }
  return false;
}

}  // namespace krot::internal
