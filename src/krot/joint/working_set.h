#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/math/norm.h"
#include "krot/problem/cost.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Of `others`, ascending, the longest tracks first, every point that sees a
// frame of which fewer than `count` observations are tied so far: `tied`, per
// frame, and those of the points before it. Where ranks share the points all
// call it, with the same `tied`, and each gets its own of those that one
// process takes. O(observations).
std::vector<int32_t> FindTies(const KnownRotationProblem& problem,
                              std::vector<int32_t> others, int count,
                              std::vector<int64_t> tied,
                              const Context& context);

// The observations of a problem that the joint solver looks at: of points whose
// residuals come near the maximum those that do, and enough others to tie every
// frame. The optimum of a working set is a lower bound on that of the whole,
// and equals it as soon as all other observations fit in below.
//
// Where ranks share the points each has its share of the set, which is the one
// that one process has; they call what is O(observations) together.
class WorkingSet {
 public:
  // Empty. Keeps a reference to `problem`.
  explicit WorkingSet(const KnownRotationProblem& problem,
                      const Context& context = {});

  // Takes in points that have an observation outside of the set whose residual
  // is above `level`, pixels, the worst first and at most `max_points` of them;
  // returns how many. Of each it takes the observations above `share` of the
  // level, and a few more if these are few: the least that holds a point well.
  // With a share of 0 it takes all. O(observations).
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
  // Of the whole set.
  int64_t num_points() const { return num_points_; }
  // Of the share here, ascending.
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
  // Of the share here.
  int64_t num_points_here_ = 0;
  int64_t num_observations_here_ = 0;
  // Of the whole: the set's, all, and the points before the share here.
  int64_t num_points_ = 0;
  int64_t num_observations_ = 0;
  int64_t num_observations_of_whole_;
  int64_t first_point_ = 0;
};

// The share with which the joint solver calls AddAbove; 0 where the baselines
// that set the scale are tiny beside the depths: what a few observations tell
// of it is lost in roundings. O(observations), by all ranks together.
double ShareOfLevel(const KnownRotationProblem& problem,
                    const Estimate& estimate, const Context& context);

// The set that the joint solver begins with at an estimate of positive depths:
// the points above some share of `cost`, pixels, which is the estimate's, with
// their observations above ShareOfLevel, and ties of every frame.
// O(observations).
WorkingSet FirstWorkingSet(const KnownRotationProblem& problem,
                           const Estimate& estimate, Norm norm, double cost,
                           const Context& context = {});

// Lowers the largest residual of every point that is above `level`, pixels, as
// the frames stand, to its optimum; points behind a camera stay. Whether there
// are none of those. O(observations).
bool PlacePoints(const KnownRotationProblem& problem, Norm norm,
                 const Context& context, double level, Estimate* estimate);

// Extends the solution of a working set, whose cost is `level`, to all other
// observations, so that no residual exceeds `highest` >= level, pixels. Points
// stay where they are if that is good enough, and otherwise take their own
// optimum as the frames stand. If that does not suffice, sweeps move the frames
// as well, and the set's points with them: its solution is seldom the only one,
// and what leaves a point above it is often a frame that the set hardly holds.
//
// Whether it succeeded; `estimate` is as far as it came either way. Points
// behind a camera stay there, and it fails. O(observations) per sweep.
bool ExtendSolution(const KnownRotationProblem& problem, Norm norm,
                    const Context& context, double level, double highest,
                    Estimate* estimate);

}  // namespace krot::internal
