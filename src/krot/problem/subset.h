#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// A subset of a problem's observations as a problem of its own. It has only the
// points, views and frames of these observations, in the order of the whole
// problem ("the whole"). Its optimal cost is at most that of the whole. A
// subset with everything refers to the whole instead of copying it.
class ProblemSubset {
 public:
  // `observations` must ascend strictly and be indices of `whole` (throws
  // std::invalid_argument). Keeps a reference to `whole`. O(observations given
  // + points + views + frames).
  ProblemSubset(const KnownRotationProblem& whole,
                std::vector<int64_t> observations);

  // The subset with everything.
  explicit ProblemSubset(const KnownRotationProblem& whole) : whole_(whole) {}

  const KnownRotationProblem& problem() const {
    return copy_ ? *copy_ : whole_;
  }
  bool IsWhole() const { return copy_ == nullptr; }

  // The index in the whole of the subset's observation.
  int64_t InWhole(int64_t observation) const {
    return IsWhole() ? observation : observation_of_[observation];
  }
  std::vector<int64_t> InWhole(std::vector<int64_t> observations) const;

  // The index in the subset of a view or point of the whole; none if it is not
  // in the subset.
  std::optional<int32_t> FindView(int32_t view) const;
  std::optional<int32_t> FindPoint(int32_t point) const;

  // The subset's part of an estimate of the whole.
  Estimate Restrict(const Estimate& whole) const;

  // Replaces the subset's part of `whole`.
  void Replace(const Estimate& estimate, Estimate* whole) const;

 private:
  void Copy(const std::vector<char>& has_point,
            const std::vector<char>& has_view,
            const std::vector<char>& has_frame);

  const KnownRotationProblem& whole_;
  // Empty if it refers to the whole. Otherwise the problem, and the indices of
  // its observations, points, views and frames in the whole.
  std::unique_ptr<KnownRotationProblem> copy_;
  std::vector<int64_t> observation_of_;
  std::vector<int32_t> point_of_;
  std::vector<int32_t> view_of_;
  std::vector<int32_t> frame_of_;
};

// Drops every observation that is the only one of a point or a frame that is
// not fixed, until there are no such observations. Such a point or frame can be
// moved until the residual is zero, so the observation contributes nothing to a
// bound. Takes and returns ascending indices. O(observations given + points +
// frames).
std::vector<int64_t> PruneUnconstrained(
    const KnownRotationProblem& problem,
    const std::vector<int64_t>& observations);

// Where ranks share the points: a subset of the observations, with their
// points, gathered on the first rank. The index of an observation "in the
// whole" counts through the problems of rank 0, 1, ... one after another.
//
// Every rank makes one, and all call Collect and Scatter together.
class GatheredPart {
 public:
  // `observations` are those of this rank's `problem` to gather, ascending.
  GatheredPart(const KnownRotationProblem& problem,
               const std::vector<int64_t>& observations, Ranks* ranks);

  // On the first rank: all frames and views, and the gathered points in the
  // order of the whole. On others: without points.
  const KnownRotationProblem& problem() const { return problem_; }
  // Per observation of problem(), its index in the whole; ascending.
  const std::vector<int64_t>& in_whole() const { return in_whole_; }

  // Returns, on the first rank, the estimate of problem() from the estimates of
  // all ranks.
  Estimate Collect(const Estimate& estimate) const;
  // The inverse: sets all frames and the gathered points of every rank's
  // estimate to their positions in the first rank's `part`.
  void Scatter(const Estimate& part, Estimate* estimate) const;

 private:
  Ranks& ranks_;
  std::vector<int32_t> points_;      // gathered points of this rank
  std::vector<int64_t> num_points_;  // per rank
  KnownRotationProblem problem_;
  std::vector<int64_t> in_whole_;
};

// Connected components of the graph whose nodes are frames and points and whose
// edges are observations. Each can be moved on its own without changing the
// cost, unless something in it is fixed.
struct Components {
  int32_t count = 0;
  std::vector<int32_t> of_frame;  // -1: the frame has no observation
  std::vector<int32_t> of_point;  // -1: the point has no observation
};

// Components are numbered in the order of their first frames. Where ranks share
// the points, the components are those of the whole problem. O(observations) up
// to the inverse Ackermann function.
Components FindComponents(const KnownRotationProblem& problem,
                          const Context& context = {});

// The indices of all observations by connected component: each list ascending,
// and the components in the order of their first frames.
std::vector<std::vector<int64_t>> SplitIntoComponents(
    const KnownRotationProblem& problem);

// The same for the given observations (ascending), by components of the graph
// with these edges only. O(observations given + points + frames).
std::vector<std::vector<int64_t>> SplitIntoComponents(
    const KnownRotationProblem& problem, std::vector<int64_t> observations);

}  // namespace krot::internal
