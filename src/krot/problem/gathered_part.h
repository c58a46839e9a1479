#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/ranks.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Some observations of a problem whose points ranks share, and the points that
// they see, on the first rank. Numbers of observations "in the whole" count
// through the ranks' problems, one after another.
//
// Every rank makes one, and they call Collect and Scatter together.
class GatheredPart {
 public:
  // `observations` of this rank's `problem`, ascending.
  GatheredPart(const KnownRotationProblem& problem,
               const std::vector<int64_t>& observations, Ranks* ranks);

  // On the first rank: all frames and views, the points in the order of the
  // whole. On others: without points.
  const KnownRotationProblem& problem() const { return problem_; }
  // Of its observations, ascending.
  const std::vector<int64_t>& in_whole() const { return in_whole_; }

  // On the first rank, what estimates of the ranks say of it.
  Estimate Collect(const Estimate& estimate) const;
  // Every frame's and these points' positions from the first rank's estimate.
  void Scatter(const Estimate& part, Estimate* estimate) const;

 private:
  Ranks& ranks_;
  std::vector<int32_t> points_;      // here
  std::vector<int64_t> num_points_;  // per rank
  KnownRotationProblem problem_;
  std::vector<int64_t> in_whole_;
};

}  // namespace krot
