#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/model.h"
#include "krot/outliers/conflict.h"
#include "krot/outliers/removal.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Where to look for a small conflict of an observation: in a few frames of its
// track, among the points there whose rays miss each other by most.
class Neighbourhoods {
 public:
  // Keeps references. Cameras stand as in `estimate`.
  Neighbourhoods(const KnownRotationProblem& problem, const Estimate& estimate);

  // Sets of frames of the track of observation i, beside its own: pairs of the
  // most strained, for num_others = 2, or all. Only those of free observations.
  std::vector<std::vector<int32_t>> FrameSets(
      int64_t i, int num_others, const std::vector<char>& is_free) const;

  // Observation i, and in its frame and the others the free ones of its own
  // point and of the most strained that two of them see. Ascending.
  std::vector<int64_t> Around(int64_t i, std::vector<int32_t> frames,
                              const std::vector<char>& is_free) const;

 private:
  int32_t FrameOf(int64_t i) const {
    return problem_.views[problem_.observations[i].view].frame;
  }
  Eigen::Vector3d Direction(int64_t i) const;
  Eigen::Vector3d CentreOf(int64_t i) const;
  double Strain(int64_t i, int64_t j) const;
  void AddStrained(int32_t a, int32_t b, const std::vector<char>& is_free,
                   std::vector<int32_t>* points) const;

  const KnownRotationProblem& problem_;
  const Estimate& estimate_;
  std::vector<std::vector<int32_t>> points_of_frame_;  // ascending
};

// What is scarce where open observations look for conflicts: no two may share
// an observation.

// How dispensable observations are, in [0, 1]: those that are not free not at
// all, those of a track that an open one has little else of less than others.
std::vector<float> Worths(const KnownRotationProblem& problem,
                          const std::vector<char>& is_free,
                          const std::vector<int64_t>& open);

// Takes those out of `open` whose view has not enough free observations for a
// conflict in two views of each, which needs two. Both keep their order.
std::vector<int64_t> TakeCrowded(const KnownRotationProblem& problem,
                                 const std::vector<char>& is_free,
                                 std::vector<int64_t>* open);

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

// What is found of the conflicts that removed observations take part in.
struct ConflictPacking {
  std::vector<Conflict> conflicts;
  bool is_complete = true;  // false: it ended for want of work
};

// An endoscope's model needs 1,300, and most fewer than 300.
inline constexpr int64_t kMostWork = 1500;

// Disjoint conflicts, each of which charges one of the removed observations
// with what others it does not go together with, so that as many as possible
// have one of their own. For each, those that barely miss the bound first, as
// they have the least choice, it looks
//
//   in its image alone and one other of its track, with the companions that
//     others need least,
//   in two others, then in all, among the observations there whose rays miss
//     each other by most,
//   and at last among the removal's tight observations,
//
// first among those that are neither removed nor taken already, so that no
// other has to share the charge, then with the removed ones that found none.
// Small conflicts leave more to others.
//
// Those that are `found` already, without a common observation, stay, and come
// first.
//
// Where hardly anything can be decided, as with wrong rotations, it ends with
// the conflicts so far once it has taken `work_per_observation` (Work) for each
// observation of the problem.
ConflictPacking PackAgainstRemoval(
    const Model& model, const BuiltProblem& built, const ErrorBound& bound,
    const Removal& removal, std::vector<Conflict> found, const Context& context,
    int64_t work_per_observation = kMostWork);

}  // namespace krot::internal
