#include "krot/proof/force_balance.h"

#include <algorithm>
#include <queue>
#include <tuple>
#include <utility>

namespace krot {
namespace {

using Real = long double;

// Points are nodes 0, 1, ...; frames come after them.
struct Branch {
  int32_t node;
  int32_t parent;
  int64_t observation;
};

// A maximum spanning forest [Prim 1957], parents before their children.
class StrongestForest {
 public:
  StrongestForest(const KnownRotationProblem& problem,
                  const std::vector<Real>& strength)
      : problem_(problem),
        strength_(strength),
        is_reached_(problem.num_points + problem.num_frames, false) {}

  std::vector<Branch> Grow();

 private:
  int32_t FrameNode(int64_t observation) const {
    const int32_t view = problem_.observations[observation].view;
    return problem_.num_points + problem_.views[view].frame;
  }
  template <typename Visit>
  void ForObservationsOf(int32_t node, const Visit& visit) const;
  void Reach(int32_t node);
  void Spread();

  const KnownRotationProblem& problem_;
  const std::vector<Real>& strength_;
  std::vector<bool> is_reached_;
  std::vector<Branch> branches_;
  // By strength, then the first observation; with the two ends of the branch.
  using Candidate = std::tuple<Real, int64_t, int32_t, int32_t>;
  std::priority_queue<Candidate> candidates_;
};

template <typename Visit>
void StrongestForest::ForObservationsOf(int32_t node,
                                        const Visit& visit) const {
  if (node < problem_.num_points) {
    for (int64_t i = problem_.point_begin[node];
         i < problem_.point_begin[node + 1]; ++i) {
      visit(i, FrameNode(i));
    }
    return;
  }
  const int32_t f = node - problem_.num_points;
  for (int64_t n = problem_.frame_begin[f]; n < problem_.frame_begin[f + 1];
       ++n) {
    const int64_t i = problem_.frame_observations[n];
    visit(i, problem_.observations[i].point);
  }
}

void StrongestForest::Reach(int32_t node) {
  is_reached_[node] = true;
  ForObservationsOf(node, [&](int64_t i, int32_t other) {
    if (!is_reached_[other]) candidates_.emplace(strength_[i], -i, node, other);
  });
}

// From all that is reached.
void StrongestForest::Spread() {
  while (!candidates_.empty()) {
    const auto [strength, negative, parent, node] = candidates_.top();
    candidates_.pop();
    if (is_reached_[node]) continue;
    branches_.push_back({node, parent, -negative});
    Reach(node);
  }
}

std::vector<Branch> StrongestForest::Grow() {
  for (int32_t k = 0; k < problem_.num_points; ++k) {
    if (problem_.IsFixedPoint(k)) Reach(k);
  }
  for (int32_t f = 0; f < problem_.num_frames; ++f) {
    if (problem_.IsFixedFrame(f)) Reach(problem_.num_points + f);
  }
  Spread();
  std::vector<std::pair<Real, int64_t>> order;  // the strongest first
  for (const Real strength : strength_) {
    order.emplace_back(-strength, static_cast<int64_t>(order.size()));
  }
  std::sort(order.begin(), order.end());
  for (const auto& [negative, i] : order) {
    if (is_reached_[FrameNode(i)]) continue;
    Reach(FrameNode(i));
    Spread();
  }
  return std::move(branches_);
}

}  // namespace

std::vector<Real> BoundCorrections(const KnownRotationProblem& problem,
                                   const std::vector<Real>& strength,
                                   const Imbalance& imbalance) {
  const std::vector<Branch> branches =
      StrongestForest(problem, strength).Grow();
  std::vector<Real> load = imbalance.of_point;
  load.insert(load.end(), imbalance.of_frame.begin(), imbalance.of_frame.end());
  std::vector<Real> corrections(strength.size(), 0);
  for (auto branch = branches.rbegin(); branch != branches.rend(); ++branch) {
    corrections[branch->observation] = load[branch->node] * kOutward;
    load[branch->parent] += load[branch->node];
  }
  return corrections;
}

}  // namespace krot
