#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Where to look for the smallest conflict of an observation: with two other
// points in its image and one more, six observations in all.
//
// Of two views only the direction b of the baseline matters. Observations of a
// point within a bound are two narrow cones of rays, and allow a band of
// directions: the hull of the one cone and the other reversed. Its edges are
// great circles, two half-planes n'x <= c of the chart b = e + x around the
// estimate's direction e. By Helly's theorem three bands without a common
// direction are all that it takes, and where o excludes x = 0 and j, k do not,
//
//   n_o + lambda_j n_j + lambda_k n_k = 0,   c_o + lambda_j c_j + lambda_k c_k
//   < 0
//
// with lambda > 0 is such a triple.
class TwoViewConflicts {
 public:
  // Keeps references. Cameras stand as in `estimate`; the bound is in pixels.
  TwoViewConflicts(const KnownRotationProblem& problem,
                   const Estimate& estimate, double max_error);

  // Sets of observations, ascending, that do not go together as far as this
  // tells, each with i, which is above the bound at the estimate: the most
  // dispensable first. worth[j] in [0, 1] says how dispensable another is, 0:
  // not to be used. Those in the middle of their bands are more so, and tight
  // ones are left to those that need them. O(observations of the views of i's
  // track).
  std::vector<std::vector<int64_t>> Candidates(
      int64_t i, const std::vector<float>& worth) const;

 private:
  struct HalfPlane;
  struct Candidate;
  bool AppendBand(int64_t i, int64_t j, const Eigen::Vector3d& e,
                  std::vector<HalfPlane>* planes) const;
  void AppendTriples(const HalfPlane& violated,
                     const std::vector<HalfPlane>& planes, float worth,
                     std::vector<Candidate>* candidates) const;
  Eigen::Vector3d CentreOf(int64_t i) const;

  const KnownRotationProblem& problem_;
  const Estimate& estimate_;
  const double max_error_;
  std::vector<std::vector<int64_t>> observations_of_view_;  // ascending
};

}  // namespace krot::internal
