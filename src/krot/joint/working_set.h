#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/minimax/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// The points of a problem, with all their observations, that the joint solver
// looks at: those whose residuals come near the maximum, and enough others to
// tie every frame. The optimum of a working set is a lower bound on that of
// the whole, and equals it as soon as the other points fit in below.
//
// Where ranks share the points each has its share of the set, which is the one
// that one process has; they call what is O(observations) together.
class WorkingSet {
 public:
  // Empty. Keeps a reference to `problem`.
  explicit WorkingSet(const KnownRotationProblem& problem,
                      const Context& context = {});

  // Adds the points with a residual above `level`, pixels, the worst first and
  // at most `max_points` of them; returns how many. O(observations).
  int64_t AddAbove(const Estimate& estimate, Norm norm, double level,
                   int64_t max_points);

  // Adds points, the longest tracks first, until every frame has `count`
  // observations in the set or all it has. O(observations).
  void AddTies(int count);

  void AddPoint(int32_t point);
  void AddAll();

  bool Contains(int32_t point) const { return contains_[point] != 0; }
  bool IsAll() const { return num_points_ == num_points_of_whole_; }
  int64_t num_points() const { return num_points_; }  // of the whole set
  // Of the share here, ascending.
  std::vector<int32_t> Points() const;
  std::vector<int64_t> Observations() const;
  // The largest residual of its points, pixels. O(observations).
  double Cost(const Estimate& estimate, Norm norm) const;

 private:
  const KnownRotationProblem& problem_;
  const Context context_;
  std::vector<char> contains_;  // per point
  // Of the whole: the set's, all, and those before the share here.
  int64_t num_points_ = 0;
  int64_t num_points_of_whole_;
  int64_t first_point_ = 0;
};

// The one that the joint solver begins with at an estimate of positive depths:
// the points above some share of `cost`, pixels, which is the estimate's, and
// ties of every frame. O(observations).
WorkingSet FirstWorkingSet(const KnownRotationProblem& problem,
                           const Estimate& estimate, Norm norm, double cost,
                           const Context& context = {});

}  // namespace krot
