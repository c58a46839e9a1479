#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/convert/reprojection.h"
#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// What the errors of observations are asked to stay within.
struct ErrorBound {
  Norm norm;             // p = 1, 2 or infinity
  double max_error = 0;  // true pixels; > 0
};

// The work of decisions and proofs, in iterations of the joint solver times
// observations, a few microseconds each. It is counted rather than timed, so
// that a search that ends at its limit ends at the same place every time.
struct Work {
  int64_t done = 0;
  int64_t limit = std::numeric_limits<int64_t>::max();

  bool IsUsedUp() const { return done >= limit; }
};

// Whether some observations can be satisfied together: either an estimate at
// which all their true errors are within the bound, or a support, some of them
// that no estimate brings within it, as far as the linear rows tell. Neither
// where the optimum is too near to the bound.
struct Decision {
  bool is_feasible = false;
  bool is_refuted = false;
  Estimate estimate;
  std::vector<int64_t> support;  // if refuted; ascending
};

// Decides on all observations of `part`, which must be connected, in a few
// rounds that solve the linear rows and take them anew at the solution. Starts
// from part.start or, where a depth there is not positive, from nothing. Gives
// up after a few hundred iterations. Adds to `*work`.
Decision Decide(const Model& model, const BuiltProblem& part,
                const ErrorBound& bound, const Context& context, Work* work);

// Observations that no translations and points bring within a bound together,
// so that at least one of them must go [Sim, Hartley 2006].
struct Conflict {
  std::vector<int64_t> observations;  // of the built problem, ascending
  // In the built problem's numbers; empty before ProveConflict. Its support is
  // `observations`.
  PixelCertificate proof;
  // Whether none of the observations can be spared: for each, an estimate was
  // found that satisfies all others. Large conflicts are not tested.
  bool is_irreducible = false;
};

// Finds a conflict among connected observations of `built` (ascending) and
// makes it irreducible by deletion: an observation goes if the others are still
// refuted. None if they can be satisfied together, or if nothing is decided.
// The conflict is refuted as far as the linear rows tell, not proved yet. Takes
// as many solves of the support as it has observations. Adds to `*work`.
std::optional<Conflict> FindConflict(const Model& model,
                                     const BuiltProblem& built,
                                     const ErrorBound& bound,
                                     const std::vector<int64_t>& observations,
                                     const Context& context, Work* work);

// Proves a conflict; observations that the proof does without are dropped.
// False if there is no proof. With strong lenses this takes most of the time of
// a conflict. Adds to `*work`.
bool ProveConflict(const Model& model, const BuiltProblem& built,
                   const ErrorBound& bound, const Context& context,
                   Conflict* conflict, Work* work);

// For each observation of a built problem its index among the model's track
// elements. O(track elements).
std::vector<uint64_t> ElementsOf(const Model& model, const BuiltProblem& built);

// The observations that a slack programme looks at: those that come near the
// bound, and enough others to tie their points and every frame. Its optimum is
// one of all observations as long as no other exceeds the bound there.
class NearSet {
 public:
  // Empty. Keeps a reference to `problem`.
  explicit NearSet(const KnownRotationProblem& problem);

  // Adds the observations whose errors (one each) are above `level`, and ties.
  // O(observations).
  void AddAbove(const std::vector<double>& errors, double level);

  bool Contains(int64_t i) const { return contains_[i] != 0; }
  // The connected components of its observations, each ascending.
  std::vector<std::vector<int64_t>> Parts() const;

 private:
  void TiePoint(int32_t point);
  void TieFrames();

  const KnownRotationProblem* problem_;
  std::vector<char> contains_;  // per observation
};

// Observations without which all others are within a bound.
struct Removal {
  std::vector<int64_t> observations;  // of the built problem, ascending
  // An estimate at which the true errors of all others are within the bound.
  Estimate estimate;
};

// Finds few observations to remove by the slack programme
// (conic/interior_point.h). The weights of the first one make it costly to
// exceed the bound by little at the start. Each next one has rows and weights
// from the last solution, as long as this leaves fewer observations above the
// bound [Candes, Wakin, Boyd 2008]. A programme looks at the observations that
// came near the bound so far. Points then take back what fits after all, the
// frames fixed. Never removes more than are above the bound at built.start.
//
// A search may be asked for one bound after the other: each begins with the
// estimate and the weights that the last one ended with.
class RemovalSearch {
 public:
  // Keeps references.
  RemovalSearch(const Model& model, const BuiltProblem& built, Norm norm,
                const Context& context);

  // max_error in true pixels, > 0. Solves at most `max_programmes`; with 0 of
  // them the result is what is above the bound at built.start or, if that is
  // less, at the last search's estimate, but for what points take back.
  Removal Find(double max_error, int max_programmes);

 private:
  double Error(const Estimate& estimate, int64_t i) const {
    return reprojection_.Error(estimate, norm_, i);
  }
  std::vector<double> Errors(const Estimate& estimate) const;
  std::vector<double> WeightsOfErrors() const;
  void SolveProgramme(double smallest_mu);
  void Excess(const std::vector<int64_t>& part, double smallest_mu);
  void Offer(Removal* best) const;
  bool TakeBack(Removal* best);

  const BuiltProblem& built_;
  const Norm norm_;
  const Context context_;
  const Reprojection reprojection_;
  double max_error_ = 0;
  KnownRotationProblem rows_;
  Estimate estimate_;           // of the last programme
  std::vector<double> errors_;  // there
  NearSet near_;
  std::vector<double> weights_;
};

// Where noise chose a bound for the errors at a start from nothing, the finish
// may raise them by a tenth: it needs half as many iterations with that room.
inline constexpr double kRoomOfFinish = 1.1;

// A search for a single bound.
inline constexpr int kMaxProgrammes = 16;
Removal FindRemoval(const Model& model, const BuiltProblem& built,
                    const ErrorBound& bound, const Context& context,
                    int max_programmes = kMaxProgrammes);

// The indices below `count` that are not `removed` (ascending).
std::vector<int64_t> AllBut(const std::vector<int64_t>& removed, size_t count);

// The lowest largest error of some observations, proved to a thousandth.
struct OptimumWithout {
  Estimate estimate;     // of the whole problem
  double max_error = 0;  // there, true pixels
  // No translations and points bring them below this; true pixels. 0 without a
  // proof; otherwise CheckPixelCertificate accepted it.
  double lower_bound = 0;
  std::optional<PixelCertificate> proof;  // of the built problem
};

// The optimum of all observations but the `removed` (ascending), by
// SolveInRounds from `start`, where their depths must be positive. Observations
// that alone hold a point or a frame bound nothing and are left out.
OptimumWithout SolveWithout(const Model& model, const BuiltProblem& built,
                            const std::vector<int64_t>& removed,
                            const Estimate& start, Norm norm,
                            const Context& context);

// ---- Conflicts with what was removed ----

// Where to look for a small conflict of an observation: in a few frames of its
// track, among the points with the largest strain there. The strain of two rays
// is by how much they miss each other, in pixels.
class Neighbourhoods {
 public:
  // Keeps references. Cameras stand as in `estimate`.
  Neighbourhoods(const KnownRotationProblem& problem, const Estimate& estimate);

  // The sets of frames to look in, beside the frame of observation i. For
  // num_others = 2 these are pairs of the most strained frames of its track,
  // otherwise one set of up to eight. Only frames with free observations count.
  std::vector<std::vector<int32_t>> FrameSets(
      int64_t i, int num_others, const std::vector<char>& is_free) const;

  // Observation i and the free observations, in its frame and the others, of
  // its own point and of the most strained points that two of these frames see.
  // Ascending.
  std::vector<int64_t> Around(int64_t i, std::vector<int32_t> frames,
                              const std::vector<char>& is_free) const;

 private:
  double Strain(int64_t i, int64_t j) const;
  void AddStrained(int32_t a, int32_t b, const std::vector<char>& is_free,
                   std::vector<int32_t>* points) const;

  const KnownRotationProblem& problem_;
  const Estimate& estimate_;
  std::vector<std::vector<int32_t>> points_of_frame_;  // ascending
};

// Takes out of `open` the observations in crowded views, and returns them:
// views that have fewer than two free observations for each open one, as a
// conflict in two views needs. Both keep their order.
std::vector<int64_t> TakeCrowded(const KnownRotationProblem& problem,
                                 const std::vector<char>& is_free,
                                 std::vector<int64_t>* open);

// Where to look for the smallest conflict of an observation o: with two other
// points in its image and one more, six observations in all.
//
// Of two views only the direction b of the baseline matters. Two observations
// of a point within a bound are two narrow cones of rays, and allow a band of
// directions: the hull of the one cone and the other reversed. Its edges are
// great circles, two half-planes n'x <= c of the chart b = e + x around the
// estimate's direction e. By Helly's theorem, if some bands have no common
// direction, three of them have none. Where o excludes x = 0 and j, k do not,
// these are three with lambda > 0 and
//
//   n_o + lambda_j n_j + lambda_k n_k = 0,
//   c_o + lambda_j c_j + lambda_k c_k < 0.
class TwoViewConflicts {
 public:
  // Keeps references. Cameras stand as in `estimate`; the bound is in pixels.
  TwoViewConflicts(const KnownRotationProblem& problem,
                   const Estimate& estimate, double max_error);

  // Sets of observations, ascending, each of i and free ones, that conflict as
  // far as this test tells. Observation i must be above the bound at the
  // estimate. No two conflicts may share an observation: sets of points in the
  // middle of their bands come first, so that those near an edge are left to
  // observations that need them. O(observations of the views of i's track).
  std::vector<std::vector<int64_t>> Candidates(
      int64_t i, const std::vector<char>& is_free) const;

 private:
  struct HalfPlane;
  struct Candidate;
  bool AppendBand(int64_t i, int64_t j, const Eigen::Vector3d& e,
                  std::vector<HalfPlane>* planes) const;
  void AppendTriples(const HalfPlane& violated,
                     const std::vector<HalfPlane>& planes,
                     std::vector<Candidate>* candidates) const;

  const KnownRotationProblem& problem_;
  const Estimate& estimate_;
  const double max_error_;
  std::vector<std::vector<int64_t>> observations_of_view_;  // ascending
};

// Conflicts that removed observations take part in.
struct ConflictPacking {
  std::vector<Conflict> conflicts;
  bool is_complete = true;  // false: it ended at the limit of work
};

// Packs disjoint conflicts so that as many removed observations as possible
// have one of their own: each charges a removed observation with others that
// cannot be satisfied together with it. The removed observations with the
// smallest errors come first, as they have the least choice. For each it looks
//
//   in its image alone and one other of its track, with the companions that
//     others need least,
//   in two others, then in all, among the observations there whose rays miss
//     each other by most,
//
// first among observations that are neither removed nor in a conflict, so that
// removed ones do not share a conflict, then also among the removed ones that
// found none. Small conflicts are preferred, as they leave more to others.
//
// Conflicts that are already `found`, which must be disjoint, stay and come
// first.
//
// Where hardly anything can be decided, as with wrong rotations, it ends with
// the conflicts so far once it has done `work_per_observation` (Work) for each
// observation of the problem. An endoscope's model needs 1,300, most fewer than
// 300.
ConflictPacking PackAgainstRemoval(
    const Model& model, const BuiltProblem& built, const ErrorBound& bound,
    const Removal& removal, std::vector<Conflict> found, const Context& context,
    int64_t work_per_observation = 1500);

// Removes the last two observations of a track of which more went: two agree by
// chance far more often than three do, most such pairs are wrong, and one that
// lies near a camera can turn it.
void RemoveChancePairs(const Model& model, std::vector<char>* is_removed);

}  // namespace krot::internal
