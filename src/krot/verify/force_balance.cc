#include "krot/verify/force_checker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>
#include <tuple>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/verify/certificate_check.h"

namespace krot::internal {
namespace {

using Real = ObservationForce::Real;
using Vector3 = ObservationForce::Vector3;
using Matrix3 = Eigen::Matrix<Real, 3, 3>;

constexpr Real kRoundoff = std::numeric_limits<Real>::epsilon();

}  // namespace

ObservationForce MakeForce(const Observation& observation,
                           const ObservationForce::Vector2& y,
                           Real delta_lambda) {
  const Matrix3 E = observation.E.cast<Real>();
  const Vector3 multipliers(delta_lambda, y[0], y[1]);
  return {E.transpose() * multipliers,
          E.cwiseAbs().transpose() * multipliers.cwiseAbs()};
}

Real RoundingError(size_t count) {
  return (static_cast<Real>(count) + 12) * kRoundoff;
}

Real ForceError(size_t count) {
  return 2 * (kRotationError + RoundingError(count));
}

// With e_k the rows of E, those of E^-T are e_1 x e_2, e_2 x e_0 and e_0 x e_1
// over det E = e_0'(e_1 x e_2). The rounding error of each is less than
// 4 kRoundoff times the product of the lengths of its rows. As |det E| <=
// |e_0||e_1 x e_2| and so on, lowering |det E| covers the errors of the cross
// products, too.
std::optional<Compliance> MakeCompliance(const Observation& observation) {
  const Matrix3 E = observation.E.cast<Real>();
  const auto length = [&](int i, int j) {
    return Vector3(E.row(i)).cross(Vector3(E.row(j))).norm();
  };
  const Real det =
      std::abs(E.determinant()) -
      16 * kRoundoff * E.row(0).norm() * E.row(1).norm() * E.row(2).norm();
  if (!(det > 0)) return std::nullopt;
  return Compliance{std::hypot(length(2, 0), length(0, 1)) / det * kOutward,
                    length(1, 2) / det * kOutward};
}

namespace {

// An edge of the forest. Nodes are first the points, then the frames.
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
  // Strength, negative observation index (so that of equal strengths the first
  // observation wins), and the parent and node of the branch.
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

// Grows the forest from all nodes that are reached.
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

namespace {

Real SizeOf(const Vector3& x) { return x.cwiseAbs().sum(); }

}  // namespace

FixedConstants::FixedConstants(const KnownRotationProblem& problem)
    : problem_(problem) {
  for (const Observation& observation : problem.observations) {
    const View& view = problem.views[observation.view];
    if (!problem.IsFixedFrame(view.frame)) continue;
    const Part minus_origin = OfFrame(view);  // for O = 0: in the camera
    origin_frame_ = view.frame;
    origin_ = -(view.cam_from_world_rotation.transpose().cast<Real>() *
                minus_origin.x_cam);
    origin_size_ = minus_origin.size + SizeOf(origin_);
    return;
  }
  for (const std::optional<Eigen::Vector3d>& point : problem.fixed_points) {
    if (!point) continue;
    origin_ = point->cast<Real>();
    return;
  }
}

FixedConstants::Part FixedConstants::OfFrame(const View& view) const {
  const Vector3 t = problem_.fixed_translations[view.frame]->cast<Real>();
  const Vector3 t_sr = view.cam_from_rig_translation.cast<Real>();
  return {view.cam_from_rig_rotation.cast<Real>() * t + t_sr +
              view.cam_from_world_rotation.cast<Real>() * origin_,
          SizeOf(t) + SizeOf(t_sr) + origin_size_};
}

FixedConstants::Part FixedConstants::OfPoint(const View& view,
                                             int32_t point) const {
  if (!problem_.IsFixedPoint(point)) return {};
  const Vector3 x = problem_.fixed_points[point]->cast<Real>() - origin_;
  return {view.cam_from_world_rotation.cast<Real>() * x,
          SizeOf(x) + origin_size_};
}

}  // namespace krot::internal
