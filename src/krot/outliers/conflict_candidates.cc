#include "krot/outliers/removal.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/base/numbers.h"
#include "krot/outliers/robust_start.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// The centre of the camera of observation i.
Vector3d CentreOf(const KnownRotationProblem& problem, const Estimate& estimate,
                  int64_t i) {
  const View& view = problem.views[problem.observations[i].view];
  return internal::CentreOf(
      CamFromWorld(view, estimate.translations[view.frame]));
}

}  // namespace

Neighbourhoods::Neighbourhoods(const KnownRotationProblem& problem,
                               const Estimate& estimate)
    : problem_(problem),
      estimate_(estimate),
      points_of_frame_(problem.num_frames) {
  for (int32_t f = 0; f < problem_.num_frames; ++f) {
    for (const int32_t i : problem_.OfFrame(f)) {
      const int32_t k = problem_.observations[i].point;
      std::vector<int32_t>& points = points_of_frame_[f];
      if (points.empty() || points.back() != k) points.push_back(k);
    }
  }
}

// The strain of two rays, about: their epipolar error in pixels.
double Neighbourhoods::Strain(int64_t i, int64_t j) const {
  const Vector3d baseline =
      CentreOf(problem_, estimate_, j) - CentreOf(problem_, estimate_, i);
  const Vector3d normal = baseline.cross(DirectionOf(problem_, i));
  const double length = normal.norm();
  if (!(length > 0)) return 0;
  const double angle = std::abs(normal.dot(DirectionOf(problem_, j))) / length;
  return angle * problem_.observations[j].E.bottomRows<2>().norm();
}

// Appends the most strained points of which both frames have free observations.
void Neighbourhoods::AddStrained(int32_t a, int32_t b,
                                 const std::vector<char>& is_free,
                                 std::vector<int32_t>* points) const {
  std::vector<int32_t> common;
  std::set_intersection(points_of_frame_[a].begin(), points_of_frame_[a].end(),
                        points_of_frame_[b].begin(), points_of_frame_[b].end(),
                        std::back_inserter(common));
  std::vector<std::pair<double, int32_t>> strained;  // -strain, point
  for (const int32_t k : common) {
    int64_t in_a = -1;
    int64_t in_b = -1;
    for (const int64_t i : problem_.OfPoint(k)) {
      if (!is_free[i]) continue;
      if (problem_.FrameOf(i) == a) in_a = i;
      if (problem_.FrameOf(i) == b) in_b = i;
    }
    if (in_a >= 0 && in_b >= 0) strained.emplace_back(-Strain(in_a, in_b), k);
  }
  const size_t count = std::min<size_t>(strained.size(), 64);
  std::partial_sort(strained.begin(),
                    strained.begin() + static_cast<std::ptrdiff_t>(count),
                    strained.end());
  for (size_t n = 0; n < count; ++n) points->push_back(strained[n].second);
}

std::vector<int64_t> Neighbourhoods::Around(
    int64_t i, std::vector<int32_t> frames,
    const std::vector<char>& is_free) const {
  frames.push_back(problem_.FrameOf(i));
  SortUnique(&frames);
  std::vector<int32_t> points = {problem_.observations[i].point};
  for (size_t n = 0; n < frames.size(); ++n) {
    for (size_t m = 0; m < n; ++m)
      AddStrained(frames[m], frames[n], is_free, &points);
  }
  SortUnique(&points);
  std::vector<int64_t> observations;
  for (const int32_t k : points) {
    for (const int64_t j : problem_.OfPoint(k)) {
      const bool is_there =
          std::binary_search(frames.begin(), frames.end(), problem_.FrameOf(j));
      if (j == i || (is_free[j] && is_there)) observations.push_back(j);
    }
  }
  return observations;
}

std::vector<std::vector<int32_t>> Neighbourhoods::FrameSets(
    int64_t i, int num_others, const std::vector<char>& is_free) const {
  const int32_t k = problem_.observations[i].point;
  std::vector<std::pair<double, int32_t>> strained;  // -strain, frame
  for (const int64_t j : problem_.OfPoint(k)) {
    if (is_free[j] && j != i)
      strained.emplace_back(-Strain(i, j), problem_.FrameOf(j));
  }
  std::sort(strained.begin(), strained.end());
  std::vector<int32_t> others;
  for (const auto& [strain, frame] : strained) {
    if (std::find(others.begin(), others.end(), frame) == others.end()) {
      others.push_back(frame);
    }
  }
  if (others.size() > 8) others.resize(8);
  std::vector<std::vector<int32_t>> sets;
  if (num_others == 2) {
    for (size_t n = 0; n < std::min<size_t>(others.size(), 4); ++n) {
      for (size_t m = 0; m < n; ++m) sets.push_back({others[m], others[n]});
    }
  } else if (others.size() > 2) {
    sets.push_back(others);
  }
  return sets;
}

std::vector<int64_t> TakeCrowded(const KnownRotationProblem& problem,
                                 const std::vector<char>& is_free,
                                 std::vector<int64_t>* open) {
  std::vector<int64_t> spare(problem.views.size(), 0);
  for (size_t i = 0; i < is_free.size(); ++i) {
    spare[problem.observations[i].view] += is_free[i];
  }
  const auto view_of = [&](int64_t i) { return problem.observations[i].view; };
  for (const int64_t i : *open) spare[view_of(i)] -= 2;
  std::vector<int64_t> crowded;
  std::vector<int64_t> others;
  std::partition_copy(open->begin(), open->end(), std::back_inserter(crowded),
                      std::back_inserter(others),
                      [&](int64_t i) { return spare[view_of(i)] < 0; });
  *open = std::move(others);
  return crowded;
}

namespace {

// The cone of rays within a bound, in the world, at depth 1: { x = d + P y :
// ||y|| <= 1 }.
struct RayCone {
  RayCone(const KnownRotationProblem& problem, int64_t i, double max_error) {
    const Observation& o = problem.observations[i];
    const Matrix3d world_from_row =
        problem.views[o.view].cam_from_world_rotation.transpose() *
        Matrix3d(o.E).inverse();
    d = world_from_row.col(0);
    P = max_error * world_from_row.rightCols<2>();
  }

  Vector3d d;
  Eigen::Matrix<double, 3, 2> P;
};

// Two axes across e.
std::array<Vector3d, 2> AxesAcross(const Vector3d& e) {
  const Vector3d first = e.unitOrthogonal();
  return {first, e.cross(first)};
}

}  // namespace

struct TwoViewConflicts::HalfPlane {
  Vector2d normal;   // unit
  double slack = 0;  // normal.x <= slack
  double ease = 0;   // 0: at an edge of its band, 1: in the middle
  std::array<int64_t, 2> observations;
};

struct TwoViewConflicts::Candidate {
  double ease = 0;
  std::vector<int64_t> observations;
};

TwoViewConflicts::TwoViewConflicts(const KnownRotationProblem& problem,
                                   const Estimate& estimate, double max_error)
    : problem_(problem),
      estimate_(estimate),
      max_error_(max_error),
      observations_of_view_(problem.views.size()) {
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    observations_of_view_[problem.observations[i].view].push_back(
        static_cast<int64_t>(i));
  }
}

// Appends both edges of the band of baselines from the view of i to that of j.
// False if their cones meet, or if e is not between them.
bool TwoViewConflicts::AppendBand(int64_t i, int64_t j, const Vector3d& e,
                                  std::vector<HalfPlane>* planes) const {
  const RayCone a(problem_, i, max_error_);
  const RayCone b(problem_, j, max_error_);
  Vector3d n = a.d.cross(b.d);
  const double area = n.norm();
  if (!(area > 0)) return false;
  n /= area;
  // g_a'd_a = 1, g_a'd_b = 0, and the other way round.
  const Vector3d g_a = b.d.cross(n) / area;
  const Vector3d g_b = n.cross(a.d) / area;
  const double r_a = (a.P.transpose() * n).norm();
  const double r_b = (b.P.transpose() * n).norm();
  const double parallax = area / (a.d.norm() * b.d.norm());
  if (parallax <= r_a / a.d.norm() + r_b / b.d.norm()) return false;
  const double half_width = r_a * g_a.dot(e) - r_b * g_b.dot(e);
  if (!(g_a.dot(e) > 0) || !(g_b.dot(e) < 0)) return false;
  const double off = n.dot(e);
  const std::array<Vector3d, 2> axes = AxesAcross(e);
  const double ease = 1 - std::abs(off) / half_width;
  for (const double side : {1.0, -1.0}) {
    // h'x <= 0 for all x of the one cone, h'x >= 0 for all of the other.
    const Vector3d h = side * n - r_a * g_a + r_b * g_b;
    HalfPlane plane;
    plane.normal = Vector2d(h.dot(axes[0]), h.dot(axes[1]));
    const double length = plane.normal.norm();
    if (!(length > 0)) return false;
    plane.normal /= length;
    plane.slack = (half_width - side * off) / length;
    plane.ease = ease;
    plane.observations = {i, j};
    planes->push_back(plane);
  }
  return true;
}

// Finds the two companions with the most ease. With A = n_o'n / |n_o x n| and S
// = c / |n_o x n| of planes on either side of n_o, and m = -c_o, a pair j, k is
// in conflict with o if (S_j + m A_j) + (S_k + m A_k) < 0.
void TwoViewConflicts::AppendTriples(const HalfPlane& violated,
                                     const std::vector<HalfPlane>& planes,
                                     std::vector<Candidate>* candidates) const {
  // Shares of the excess that companions may use up; below 1, as the chart is
  // only approximate.
  for (const double use : {0.97, 0.8}) {
    const double m = -use * violated.slack;
    std::array<double, 2> least;
    least.fill(kInfinity);
    std::array<const HalfPlane*, 2> best = {nullptr, nullptr};
    for (const HalfPlane& plane : planes) {
      const double cross = violated.normal.x() * plane.normal.y() -
                           violated.normal.y() * plane.normal.x();
      const double across = std::abs(cross);
      if (!(across > 0)) continue;
      const size_t side = cross > 0 ? 1 : 0;
      const double value =
          (plane.slack + m * violated.normal.dot(plane.normal)) / across;
      if (!(value < least[side])) continue;
      least[side] = value;
      best[side] = &plane;
      if (!(least[0] + least[1] < 0)) continue;
      Candidate candidate;
      candidate.ease = plane.ease;
      for (const HalfPlane* own : {&violated, best[0], best[1]}) {
        candidate.observations.insert(candidate.observations.end(),
                                      own->observations.begin(),
                                      own->observations.end());
      }
      SortUnique(&candidate.observations);
      candidates->push_back(std::move(candidate));
      break;
    }
  }
}

std::vector<std::vector<int64_t>> TwoViewConflicts::Candidates(
    int64_t i, const std::vector<char>& is_free) const {
  const Observation& own = problem_.observations[i];
  std::vector<Candidate> candidates;
  for (const int64_t j : problem_.OfPoint(own.point)) {
    const Observation& other = problem_.observations[j];
    if (j == i || !is_free[j] || other.view == own.view) continue;
    const Vector3d baseline =
        CentreOf(problem_, estimate_, j) - CentreOf(problem_, estimate_, i);
    if (!(baseline.norm() > 0)) continue;
    const Vector3d e = baseline.normalized();
    std::vector<HalfPlane> edges;
    if (!AppendBand(i, j, e, &edges)) continue;
    if (edges[0].slack >= 0 && edges[1].slack >= 0) continue;
    std::vector<HalfPlane> planes;
    const std::vector<int64_t>& in_own = observations_of_view_[own.view];
    const std::vector<int64_t>& in_other = observations_of_view_[other.view];
    size_t n = 0;
    for (const int64_t a : in_own) {
      const int32_t point = problem_.observations[a].point;
      if (point == own.point || !is_free[a]) continue;
      while (n < in_other.size() &&
             problem_.observations[in_other[n]].point < point) {
        ++n;
      }
      for (size_t l = n; l < in_other.size() &&
                         problem_.observations[in_other[l]].point == point;
           ++l) {
        const int64_t b = in_other[l];
        if (is_free[b]) AppendBand(a, b, e, &planes);
      }
    }
    std::sort(
        planes.begin(), planes.end(),
        [](const HalfPlane& a, const HalfPlane& b) { return a.ease > b.ease; });
    for (const HalfPlane& edge : edges) {
      if (edge.slack < 0) AppendTriples(edge, planes, &candidates);
    }
  }
  SortLargestFirst(&candidates, &Candidate::ease);
  std::vector<std::vector<int64_t>> sets;
  for (Candidate& candidate : candidates) {
    if (sets.size() == 4) break;
    sets.push_back(std::move(candidate.observations));
  }
  return sets;
}

}  // namespace krot::internal
