#include "krot/problem/gauge.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/geometry.h"
#include "krot/geometry/transform.h"
#include "krot/problem/cost.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// C_f = R_rw' (centre_in_rig - t_f).
Vector3d ProjectionCentre(const FrameGeometry& frame, const Vector3d& t) {
  return frame.world_from_rig * (frame.centre_in_rig - t);
}

// The place and size of a component in an estimate.
struct Extent {
  Vector3d centroid = Vector3d::Zero();  // of the centres; NaN without any
  double rms = 0;                        // distance of the centres to it
  double weight = 0;                     // total of the centres' weights
  double point_distance = 0;  // the median, from the centroid; NaN without any

  bool CentresCoincide() const {
    const double distance = std::isfinite(point_distance) ? point_distance : 0;
    return rms <= kCoincident * (centroid.norm() + distance);
  }
};

// The extent of each component; frame f's centre has the weight num_views.
std::vector<Extent> MeasureExtents(const std::vector<FrameGeometry>& frames,
                                   const std::vector<char>& point_counts,
                                   const Components& components,
                                   const Estimate& estimate,
                                   const Context& context) {
  std::vector<Extent> extents(components.count);
  const auto for_each_centre = [&](const auto& visit) {
    for (size_t f = 0; f < frames.size(); ++f) {
      if (components.of_frame[f] < 0 || frames[f].num_views == 0) continue;
      visit(ProjectionCentre(frames[f], estimate.translations[f]),
            frames[f].num_views, &extents[components.of_frame[f]]);
    }
  };
  for_each_centre([](const Vector3d& centre, int num_views, Extent* extent) {
    extent->centroid += num_views * centre;
    extent->weight += num_views;
  });
  for (Extent& extent : extents) extent.centroid /= extent.weight;
  for_each_centre([](const Vector3d& centre, int num_views, Extent* extent) {
    extent->rms += num_views * (centre - extent->centroid).squaredNorm();
  });
  for (Extent& extent : extents) {
    extent.rms = std::sqrt(extent.rms / extent.weight);
  }
  std::vector<double> distances;
  for (size_t k = 0; k < estimate.points.size(); ++k) {
    const int32_t c = components.of_point[k];
    distances.push_back(
        c < 0 || point_counts[k] == 0
            ? -1
            : (estimate.points[k] - extents[c].centroid).norm());
  }
  const std::vector<double> medians =
      GroupMedians(distances, components.of_point, components.count, context);
  for (int32_t c = 0; c < components.count; ++c) {
    extents[c].point_distance = medians[c];
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

// The fixed positions of a component.
struct Hold {
  std::optional<Vector3d> position;  // the first; none if nothing is fixed
  bool coincides = true;             // all fixed positions coincide

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

// The factor between the sizes of reference and estimate: between the sizes
// given, which are those of the centres, or, where centres coincide, between
// the distances of the points.
double ScaleBetween(const Extent& reference, const Extent& estimate,
                    double size_of_reference, double size_of_estimate) {
  const bool use_points =
      reference.CentresCoincide() || estimate.CentresCoincide();
  const double scale = use_points
                           ? reference.point_distance / estimate.point_distance
                           : size_of_reference / size_of_estimate;
  return std::isfinite(scale) && scale > 0 ? scale : 1;
}

// A move that only scales, about the fixed position.
Move ScaleAbout(const Vector3d& fixed, const Extent& reference,
                const Extent& estimate) {
  const auto distance = [&](const Extent& extent) {  // RMS
    return std::hypot(extent.rms, (extent.centroid - fixed).norm());
  };
  return {fixed, fixed,
          ScaleBetween(reference, estimate, distance(reference),
                       distance(estimate))};
}

Move MoveOnto(const Extent& reference, const Extent& estimate,
              bool scale_is_free) {
  if (!reference.centroid.allFinite()) return {};
  return {estimate.centroid, reference.centroid,
          scale_is_free
              ? ScaleBetween(reference, estimate, reference.rms, estimate.rms)
              : 1};
}

std::vector<char> ScaleIsFree(const std::vector<FrameGeometry>& frames,
                              const Components& components) {
  std::vector<char> scale_is_free(components.count, true);
  for (size_t f = 0; f < frames.size(); ++f) {
    if (frames[f].has_two_centres) {
      scale_is_free[components.of_frame[f]] = false;
    }
  }
  return scale_is_free;
}

void MoveComponents(const KnownRotationProblem& problem,
                    const std::vector<FrameGeometry>& frames,
                    const Components& components,
                    const std::vector<Move>& moves, Estimate* estimate) {
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

// The move of a component that makes the largest |U (x - g)| of its places
// nearly the least.
Move MoveTo(const std::vector<const WantedPlace*>& places, bool scale_is_free) {
  constexpr int kNumReweightings = 100;
  Vector3d mean = Vector3d::Zero();
  for (const WantedPlace* p : places) {
    mean += p->x / static_cast<double>(places.size());
  }
  double extent = 0;
  for (const WantedPlace* p : places) {
    extent = std::max(extent, (p->x - mean).norm());
  }
  const int num_unknowns =
      scale_is_free && extent > kCoincident * mean.norm() ? 4 : 3;

  Move best;
  double least = kInfinity;
  Move move;
  std::vector<double> weights(places.size(), 1);
  for (int n = 0; n <= kNumReweightings; ++n) {
    std::vector<double> ratios;
    for (const WantedPlace* p : places) {
      ratios.push_back(
          (p->unit_from_world * (p->x + move.Shift(p->x) - p->centre)).norm());
    }
    const double largest = *std::max_element(ratios.begin(), ratios.end());
    if (largest < least) {
      least = largest;
      best = move;
    }
    if (!(largest > 0)) break;
    // The unknowns are the shift of the mean and the change of scale, in units
    // of the extent.
    Eigen::Matrix4d A = Eigen::Matrix4d::Zero();
    Eigen::Vector4d b = Eigen::Vector4d::Zero();
    for (size_t i = 0; i < places.size(); ++i) {
      const WantedPlace& p = *places[i];
      if (n > 0) weights[i] *= ratios[i] / largest;
      Eigen::Matrix<double, 3, 4> J;
      J << p.unit_from_world, p.unit_from_world * ((p.x - mean) / extent);
      A += weights[i] * J.transpose() * J;
      b -= weights[i] * J.transpose() * (p.unit_from_world * (p.x - p.centre));
    }
    const Eigen::VectorXd solution = A.topLeftCorner(num_unknowns, num_unknowns)
                                         .completeOrthogonalDecomposition()
                                         .solve(b.head(num_unknowns));
    const double scale = num_unknowns == 4 ? 1 + solution[3] / extent : 1;
    if (!solution.allFinite() || !(scale > 0)) break;
    move = {mean, mean + solution.head<3>(), scale};
  }
  return best;
}

// For each frame, the median distance of the points that it sees.
std::vector<double> TypicalDistances(const KnownRotationProblem& problem,
                                     const Estimate& estimate,
                                     const Context& context) {
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(problem, estimate.translations);
  std::vector<double> distances;
  std::vector<int32_t> frame_of;
  distances.reserve(problem.observations.size());
  frame_of.reserve(problem.observations.size());
  for (const Observation& o : problem.observations) {
    distances.push_back(
        InCamera(cameras[o.view], estimate.points[o.point]).norm());
    frame_of.push_back(problem.views[o.view].frame);
  }
  return GroupMedians(distances, frame_of, problem.num_frames, context);
}

}  // namespace

std::vector<char> FindHeldFrames(const KnownRotationProblem& problem,
                                 const Estimate& reference,
                                 const Estimate& estimate,
                                 const std::vector<char>& is_loose,
                                 const Context& context) {
  const std::vector<FrameGeometry> frames = DescribeFrames(problem, context);
  const Components components = FindComponents(problem, context);
  const std::vector<double> before =
      TypicalDistances(problem, reference, context);
  const std::vector<double> after =
      TypicalDistances(problem, estimate, context);
  std::vector<std::vector<int32_t>> frames_of(components.count);
  std::vector<std::vector<CameraMove>> moves(components.count);
  for (const bool take_loose : {false, true}) {
    std::vector<char> is_empty;
    for (const auto& of_component : frames_of) {
      is_empty.push_back(of_component.empty());
    }
    for (int32_t f = 0; f < problem.num_frames; ++f) {
      const int32_t c = components.of_frame[f];
      if (c < 0 || is_empty[c] == 0) continue;
      if (!reference.translations[f].allFinite()) continue;
      if (!is_loose.empty() && is_loose[f] != 0 && !take_loose) continue;
      frames_of[c].push_back(f);
      moves[c].push_back(
          {ProjectionCentre(frames[f], reference.translations[f]),
           ProjectionCentre(frames[f], estimate.translations[f]), before[f],
           after[f]});
    }
  }
  const std::vector<char> scale_is_free = ScaleIsFree(frames, components);
  std::vector<char> is_held(problem.num_frames, 0);
  for (int32_t c = 0; c < components.count; ++c) {
    const std::vector<char> keeps = FindConsensus(moves[c], scale_is_free[c]);
    for (size_t n = 0; n < keeps.size(); ++n) {
      is_held[frames_of[c][n]] = keeps[n];
    }
  }
  return is_held;
}

void RestoreGauge(const KnownRotationProblem& problem,
                  const Estimate& reference, Estimate* estimate,
                  const Context& context, const std::vector<char>* held) {
  const Components components = FindComponents(problem, context);
  std::vector<FrameGeometry> frames = DescribeFrames(problem, context);
  const std::vector<char> is_held =
      held != nullptr
          ? *held
          : FindHeldFrames(problem, reference, *estimate, {}, context);
  const std::vector<char> scale_is_free = ScaleIsFree(frames, components);
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    if (is_held[f] == 0) frames[f].num_views = 0;
  }
  std::vector<char> point_counts;
  for (const Vector3d& point : reference.points) {
    point_counts.push_back(point.allFinite());
  }
  const std::vector<Extent> wanted =
      MeasureExtents(frames, point_counts, components, reference, context);
  const std::vector<Extent> found =
      MeasureExtents(frames, point_counts, components, *estimate, context);
  const std::vector<Hold> holds = FindHolds(problem, frames, components);
  std::vector<Move> moves(components.count);
  for (int32_t c = 0; c < components.count; ++c) {
    if (!holds[c].position) {
      moves[c] = MoveOnto(wanted[c], found[c], scale_is_free[c]);
    } else if (scale_is_free[c] && holds[c].coincides) {
      moves[c] = ScaleAbout(*holds[c].position, wanted[c], found[c]);
    }
  }

  MoveComponents(problem, frames, components, moves, estimate);
}

void RestoreGaugeIfHarmless(const KnownRotationProblem& problem,
                            const Estimate& reference, Norm norm,
                            const Context& context, Estimate* estimate,
                            const std::vector<char>* held) {
  Estimate moved = *estimate;
  RestoreGauge(problem, reference, &moved, context, held);
  const auto cost = [&](const Estimate& x) {
    return MaxOfRanks(context, Cost(problem, x, norm, context.num_threads));
  };
  if (cost(moved) <= (1 + kErrorRounding) * cost(*estimate)) {
    *estimate = std::move(moved);
  }
}

void MoveToPlaces(const KnownRotationProblem& problem,
                  const std::vector<WantedPlace>& places, Estimate* estimate) {
  const Components components = FindComponents(problem);
  const std::vector<FrameGeometry> frames = DescribeFrames(problem, {});
  const std::vector<char> scale_is_free = ScaleIsFree(frames, components);
  const std::vector<Hold> holds = FindHolds(problem, frames, components);
  std::vector<std::vector<const WantedPlace*>> places_of(components.count);
  for (const WantedPlace& place : places) {
    const int32_t component = place.frame >= 0
                                  ? components.of_frame[place.frame]
                                  : components.of_point[place.point];
    if (component >= 0) places_of[component].push_back(&place);
  }
  std::vector<Move> moves(components.count);
  for (int32_t c = 0; c < components.count; ++c) {
    if (holds[c].position || places_of[c].empty()) continue;
    moves[c] = MoveTo(places_of[c], scale_is_free[c]);
  }
  MoveComponents(problem, frames, components, moves, estimate);
}

void NormalizeScale(const KnownRotationProblem& problem, Estimate* estimate) {
  const double median = MedianDepth(problem, *estimate);
  for (Vector3d& t : estimate->translations) t /= median;
  for (Vector3d& s : estimate->points) s /= median;
}

}  // namespace krot::internal
