#include "krot/problem/gauge.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "krot/problem/components.h"
#include "krot/problem/cost.h"
#include "krot/problem/frame_geometry.h"

namespace krot {
namespace {

// What a change of coordinates may add to the cost, relative.
constexpr double kHarmless = 1e-9;

using Eigen::Matrix3d;
using Eigen::Vector3d;

// C_f = R_rw' (centre_in_rig - t_f).
Vector3d ProjectionCentre(const FrameGeometry& frame, const Vector3d& t) {
  return frame.world_from_rig * (frame.centre_in_rig - t);
}

// Where a component's centres or points lie, and how far apart.
struct Spread {
  Vector3d centroid = Vector3d::Zero();
  double rms = 0;  // distance to the centroid
  double weight = 0;
};

// One per component; position n counts weights[n] times. The centroid is NaN
// where nothing counts.
std::vector<Spread> MeasureSpreads(const std::vector<Vector3d>& positions,
                                   const std::vector<int>& weights,
                                   const std::vector<int32_t>& component_of,
                                   int32_t num_components,
                                   const Context& context) {
  std::vector<Spread> spreads(num_components);
  context.InTurn(
      [&](std::vector<Spread>* sums) {
        for (size_t n = 0; n < positions.size(); ++n) {
          if (component_of[n] < 0 || weights[n] == 0) continue;
          Spread& sum = (*sums)[component_of[n]];
          sum.centroid += weights[n] * positions[n];
          sum.weight += weights[n];
        }
      },
      &spreads);
  for (Spread& spread : spreads) spread.centroid /= spread.weight;
  context.InTurn(
      [&](std::vector<Spread>* sums) {
        for (size_t n = 0; n < positions.size(); ++n) {
          if (component_of[n] < 0 || weights[n] == 0) continue;
          Spread& sum = (*sums)[component_of[n]];
          sum.rms += weights[n] * (positions[n] - sum.centroid).squaredNorm();
        }
      },
      &spreads);
  for (Spread& spread : spreads) {
    spread.rms = std::sqrt(spread.rms / spread.weight);
  }
  return spreads;
}

// How large one component is in one estimate.
struct Extent {
  Spread centres;
  Spread points;
  // From the centroid of the centres; unlike the RMS of the points it means
  // something when one of them lies nearly at infinity.
  double nearest_point = std::numeric_limits<double>::infinity();

  bool CentresCoincide() const {
    const double distance = std::isfinite(nearest_point) ? nearest_point : 0;
    return centres.rms <= kCoincident * (centres.centroid.norm() + distance);
  }
};

std::vector<Extent> MeasureExtents(const std::vector<FrameGeometry>& frames,
                                   const std::vector<int>& point_weights,
                                   const Components& components,
                                   const Estimate& estimate,
                                   const Context& context) {
  std::vector<Vector3d> centres;
  std::vector<int> num_views;
  for (size_t f = 0; f < frames.size(); ++f) {
    centres.push_back(ProjectionCentre(frames[f], estimate.translations[f]));
    num_views.push_back(frames[f].num_views);
  }
  const std::vector<Spread> of_centres =
      MeasureSpreads(centres, num_views, components.of_frame, components.count,
                     context.Alone());
  const std::vector<Spread> of_points =
      MeasureSpreads(estimate.points, point_weights, components.of_point,
                     components.count, context);

  std::vector<Extent> extents(components.count);
  for (int32_t c = 0; c < components.count; ++c) {
    extents[c].centres = of_centres[c];
    extents[c].points = of_points[c];
  }
  std::vector<double> nearest(components.count,
                              std::numeric_limits<double>::infinity());
  for (size_t k = 0; k < estimate.points.size(); ++k) {
    const int32_t c = components.of_point[k];
    if (c < 0 || point_weights[k] == 0) continue;
    nearest[c] = std::min(
        nearest[c], (estimate.points[k] - extents[c].centres.centroid).norm());
  }
  context.Reduce([](double a, double b) { return std::min(a, b); }, &nearest);
  for (int32_t c = 0; c < components.count; ++c) {
    extents[c].nearest_point = nearest[c];
  }
  return extents;
}

// x -> to + scale (x - from).
struct Move {
  Vector3d from = Vector3d::Zero();
  Vector3d to = Vector3d::Zero();
  double scale = 1;

  // Exactly zero if nothing needs to move.
  Vector3d Shift(const Vector3d& x) const {
    return (to - from) + (scale - 1) * (x - from);
  }
};

// What is fixed in a component.
struct Hold {
  std::optional<Vector3d> position;  // of the first; none: nothing is
  bool coincides = true;             // all of it does

  void Add(const Vector3d& x) {
    if (!position) position = x;
    coincides &= (x - *position).norm() <= kCoincident * position->norm();
  }
};

std::vector<Hold> FindHolds(const KnownRotationProblem& problem,
                            const std::vector<FrameGeometry>& frames,
                            const Components& components) {
  std::vector<Hold> holds(components.count);
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    if (!problem.IsFixedFrame(f) || components.of_frame[f] < 0) continue;
    holds[components.of_frame[f]].Add(
        ProjectionCentre(frames[f], *problem.fixed_translations[f]));
  }
  for (int32_t k = 0; k < problem.num_points; ++k) {
    if (!problem.IsFixedPoint(k) || components.of_point[k] < 0) continue;
    holds[components.of_point[k]].Add(*problem.fixed_points[k]);
  }
  return holds;
}

// The scale alone, about what is fixed.
Move ScaleAbout(const Vector3d& fixed, const Extent& reference,
                const Extent& estimate) {
  const bool use_points =
      reference.CentresCoincide() || estimate.CentresCoincide();
  const auto distance = [&](const Extent& extent) {  // RMS
    const Spread& spread = use_points ? extent.points : extent.centres;
    return std::hypot(spread.rms, (spread.centroid - fixed).norm());
  };
  Move move{fixed, fixed, distance(reference) / distance(estimate)};
  if (!std::isfinite(move.scale) || !(move.scale > 0)) move.scale = 1;
  return move;
}

Move MoveOnto(const Extent& reference, const Extent& estimate,
              bool scale_is_free) {
  const bool use_points =
      reference.CentresCoincide() || estimate.CentresCoincide();
  const Spread& to = use_points ? reference.points : reference.centres;
  const Spread& from = use_points ? estimate.points : estimate.centres;

  if (!to.centroid.allFinite()) return {};
  Move move{from.centroid, to.centroid, 1};
  if (scale_is_free && from.rms > 0 && to.rms > 0) {
    move.scale = to.rms / from.rms;
  }
  return move;
}

}  // namespace

void RestoreGauge(const KnownRotationProblem& problem,
                  const Estimate& reference, Estimate* estimate,
                  const Context& context) {
  const Components components = FindComponents(problem, context);
  std::vector<FrameGeometry> frames = DescribeFrames(problem, context);
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    if (!reference.translations[f].allFinite()) frames[f].num_views = 0;
  }
  std::vector<int> point_weights;
  for (const Vector3d& point : reference.points) {
    point_weights.push_back(point.allFinite());
  }
  const std::vector<Extent> wanted =
      MeasureExtents(frames, point_weights, components, reference, context);
  const std::vector<Extent> found =
      MeasureExtents(frames, point_weights, components, *estimate, context);

  std::vector<char> scale_is_free(components.count, true);
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    if (frames[f].has_two_centres) {
      scale_is_free[components.of_frame[f]] = false;
    }
  }
  const std::vector<Hold> holds = FindHolds(problem, frames, components);
  std::vector<Move> moves(components.count);
  for (int32_t c = 0; c < components.count; ++c) {
    if (!holds[c].position) {
      moves[c] = MoveOnto(wanted[c], found[c], scale_is_free[c]);
    } else if (scale_is_free[c] && holds[c].coincides) {
      moves[c] = ScaleAbout(*holds[c].position, wanted[c], found[c]);
    }
  }

  for (int32_t f = 0; f < problem.num_frames; ++f) {
    const int32_t component = components.of_frame[f];
    if (component < 0 || problem.IsFixedFrame(f)) continue;
    Vector3d& t = estimate->translations[f];
    const Vector3d shift =
        moves[component].Shift(ProjectionCentre(frames[f], t));
    t -= frames[f].world_from_rig.transpose() * shift;
  }
  for (int32_t k = 0; k < problem.num_points; ++k) {
    const int32_t component = components.of_point[k];
    if (component < 0 || problem.IsFixedPoint(k)) continue;
    estimate->points[k] += moves[component].Shift(estimate->points[k]);
  }
}

void RestoreGaugeIfHarmless(const KnownRotationProblem& problem,
                            const Estimate& reference, Norm norm,
                            const Context& context, Estimate* estimate) {
  Estimate moved = *estimate;
  RestoreGauge(problem, reference, &moved, context);
  const auto cost = [&](const Estimate& x) {
    return context.Max(Cost(problem, x, norm, context.num_threads));
  };
  if (cost(moved) <= (1 + kHarmless) * cost(*estimate)) {
    *estimate = std::move(moved);
  }
}

void NormalizeScale(const KnownRotationProblem& problem, Estimate* estimate) {
  const double median = MedianDepth(problem, *estimate);
  for (Vector3d& t : estimate->translations) t /= median;
  for (Vector3d& s : estimate->points) s /= median;
}

}  // namespace krot
