#include "krot/outliers/packing.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include <Eigen/Geometry>

#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// For two frames, so many of the points that both see are looked at, the most
// strained ones.
constexpr int kStrainedPoints = 64;
// At most so many frames of a track are looked at together.
constexpr size_t kMaxFramesTogether = 8;
constexpr size_t kFramesInTriples = 4;

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

// The direction in the world of the ray on which v = 0.
Vector3d Neighbourhoods::Direction(int64_t i) const {
  const Observation& o = problem_.observations[i];
  const Vector3d u = o.E.row(1).cross(o.E.row(2)).transpose();
  return (problem_.views[o.view].cam_from_world_rotation.transpose() * u)
      .normalized();
}

Vector3d Neighbourhoods::CentreOf(int64_t i) const {
  const View& view = problem_.views[problem_.observations[i].view];
  const AffineMap map = CamFromWorld(view, estimate_.translations[view.frame]);
  return -map.leftCols<3>().transpose() * map.col(3);
}

// The strain of two rays, about: their epipolar error in pixels.
double Neighbourhoods::Strain(int64_t i, int64_t j) const {
  const Vector3d baseline = CentreOf(j) - CentreOf(i);
  const Vector3d normal = baseline.cross(Direction(i));
  const double length = normal.norm();
  if (!(length > 0)) return 0;
  const double angle = std::abs(normal.dot(Direction(j))) / length;
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
  const size_t count =
      std::min(strained.size(), static_cast<size_t>(kStrainedPoints));
  std::partial_sort(strained.begin(),
                    strained.begin() + static_cast<std::ptrdiff_t>(count),
                    strained.end());
  for (size_t n = 0; n < count; ++n) points->push_back(strained[n].second);
}

std::vector<int64_t> Neighbourhoods::Around(
    int64_t i, std::vector<int32_t> frames,
    const std::vector<char>& is_free) const {
  frames.push_back(problem_.FrameOf(i));
  std::sort(frames.begin(), frames.end());
  frames.erase(std::unique(frames.begin(), frames.end()), frames.end());
  std::vector<int32_t> points = {problem_.observations[i].point};
  for (size_t n = 0; n < frames.size(); ++n) {
    for (size_t m = 0; m < n; ++m)
      AddStrained(frames[m], frames[n], is_free, &points);
  }
  std::sort(points.begin(), points.end());
  points.erase(std::unique(points.begin(), points.end()), points.end());
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
  if (others.size() > kMaxFramesTogether) others.resize(kMaxFramesTogether);
  std::vector<std::vector<int32_t>> sets;
  if (num_others == 2) {
    for (size_t n = 0; n < std::min(others.size(), kFramesInTriples); ++n) {
      for (size_t m = 0; m < n; ++m) sets.push_back({others[m], others[n]});
    }
  } else if (others.size() > 2) {
    sets.push_back(others);
  }
  return sets;
}

namespace {

// The worth of an observation that others of its track need.
constexpr float kWorthToItsTrack = 0.3F;
// Free observations that a conflict in two views takes from the open one's
// view.
constexpr int64_t kCompanions = 2;

}  // namespace

std::vector<float> Worths(const KnownRotationProblem& problem,
                          const std::vector<char>& is_free,
                          const std::vector<int64_t>& open) {
  std::vector<float> worth(is_free.begin(), is_free.end());
  for (const int64_t i : open) {
    const int32_t k = problem.observations[i].point;
    const int64_t begin = problem.point_begin[k];
    const int64_t end = problem.point_begin[k + 1];
    if (std::count(&is_free[0] + begin, &is_free[0] + end, 1) > 2) continue;
    for (int64_t j = begin; j < end; ++j) {
      if (is_free[j]) worth[j] = kWorthToItsTrack;
    }
  }
  return worth;
}

std::vector<int64_t> TakeCrowded(const KnownRotationProblem& problem,
                                 const std::vector<char>& is_free,
                                 std::vector<int64_t>* open) {
  std::vector<int64_t> spare(problem.views.size(), 0);
  for (size_t i = 0; i < is_free.size(); ++i) {
    spare[problem.observations[i].view] += is_free[i];
  }
  const auto view_of = [&](int64_t i) { return problem.observations[i].view; };
  for (const int64_t i : *open) spare[view_of(i)] -= kCompanions;
  std::vector<int64_t> crowded;
  std::vector<int64_t> others;
  std::partition_copy(open->begin(), open->end(), std::back_inserter(crowded),
                      std::back_inserter(others),
                      [&](int64_t i) { return spare[view_of(i)] < 0; });
  *open = std::move(others);
  return crowded;
}

}  // namespace krot::internal
