#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/math/norm.h"
#include "krot/problem/cost.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// The observations of a problem that the joint solver looks at: those with
// residuals near the maximum, and enough others to tie every frame. The optimum
// of a working set is a lower bound on that of the whole. Both are equal if all
// other observations can have residuals below it as well.
//
// Where ranks share the points, each has its share of the set, and all ranks
// together have the set that one process would have. All must call the
// functions that are O(observations) together.
class WorkingSet {
 public:
  // Empty. Keeps a reference to `problem`.
  explicit WorkingSet(const KnownRotationProblem& problem,
                      const Context& context = {});

  // Adds points that have an observation outside of the set whose residual is
  // above `level`, pixels: the worst first, at most `max_points` of them.
  // Returns how many. Of each point it takes the observations above
  // `share` * `level`, but at least four if there are so many; with a share of
  // 0, all. O(observations).
  int64_t AddAbove(const Estimate& estimate, Norm norm, double level,
                   int64_t max_points, double share = 0);

  // Adds whole points, the longest tracks first, until every frame has `count`
  // observations in the set or all it has. O(observations).
  void AddTies(int count);

  void AddPoint(int32_t point);  // with all its observations
  void AddAll();

  // Whether the set has an observation of the point.
  bool Contains(int32_t point) const { return contains_[point] != 0; }
  bool IsAll() const { return num_observations_ == num_observations_of_whole_; }
  // Points of the whole set, over all ranks.
  int64_t num_points() const { return num_points_; }
  // Observations of this rank's share, ascending.
  std::vector<int64_t> Observations() const;
  // The largest residual of its observations, pixels. O(observations).
  double Cost(const Estimate& estimate, Norm norm) const;

 private:
  double LargestOutside(const std::vector<AffineMap>& cameras,
                        const Estimate& estimate, Norm norm, int32_t k) const;
  void Take(int64_t observation);
  void TakePoint(int32_t point);
  void CountTaken();

  const KnownRotationProblem& problem_;
  const Context context_;
  std::vector<char> contains_;  // per point
  std::vector<char> takes_;     // per observation
  // Counts of the set on this rank.
  int64_t num_points_here_ = 0;
  int64_t num_observations_here_ = 0;
  // Over all ranks: counts of the set, the number of all observations, and the
  // number of points on the ranks before this one.
  int64_t num_points_ = 0;
  int64_t num_observations_ = 0;
  int64_t num_observations_of_whole_;
  int64_t first_point_ = 0;
};

// The longest of the rigs' baselines, scene units; 0 if there are none.
double LongestBaseline(const KnownRotationProblem& problem);
// Baselines below this, relative to the median depth, hardly set the scale.
inline constexpr double kTinyBaseline = 1e-3;

// The `share` with which the joint solver calls AddAbove. It is 0 where the
// baselines that set the scale are tiny beside the depths: a few observations
// would determine the scale only up to rounding. O(observations); all ranks
// must call it.
double ShareOfLevel(const KnownRotationProblem& problem,
                    const Estimate& estimate, const Context& context);

// The working set with which the joint solver begins, at an estimate of
// positive depths whose cost is `cost`, pixels: points above 0.9 of the cost
// (AddAbove, with ShareOfLevel), and ties of every frame. O(observations).
WorkingSet FirstWorkingSet(const KnownRotationProblem& problem,
                           const Estimate& estimate, Norm norm, double cost,
                           const Context& context = {});

// Moves every point with a residual above `level`, pixels, towards the optimum
// of its largest residual with the frames fixed; points behind a camera stay.
// Returns whether there are no such points. O(observations).
bool PlacePoints(const KnownRotationProblem& problem, Norm norm,
                 const Context& context, double level, Estimate* estimate);

// Extends the solution of a working set, whose cost is `level`, to all other
// observations, so that no residual exceeds `highest` >= level, pixels. Points
// with residuals above `level` are moved by PlacePoints. If that does not
// suffice, sweeps move the frames and all points: the set's solution is seldom
// unique, and a point often stays above it because the set hardly determines
// one of its frames.
//
// Returns whether it succeeded; `estimate` keeps what was reached in any case.
// Fails if a point is behind a camera, where it stays. O(observations) per
// sweep.
bool ExtendSolution(const KnownRotationProblem& problem, Norm norm,
                    const Context& context, double level, double highest,
                    Estimate* estimate);

}  // namespace krot::internal
