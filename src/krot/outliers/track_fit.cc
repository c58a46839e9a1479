#include "krot/outliers/track_fit.h"

#include <cmath>
#include <numeric>
#include <optional>
#include <utility>

#include "krot/analysis/noise.h"
#include "krot/analysis/track_noise.h"
#include "krot/base/disjoint_sets.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/bridge/bridge.h"
#include "krot/model/image_geometry.h"
#include "krot/model/remove_observations.h"
#include "krot/outliers/robust_points.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

constexpr int64_t kTracksPerTask = 64;

// Whether there was one above the bound, or behind its camera, in a track of
// more than one.
bool RemoveWorst(const Point3D& point, double max_error_px, TrackNoise* fit) {
  std::optional<uint64_t> worst;
  double largest = max_error_px;
  int64_t num = 0;
  for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
    if (!fit->TakesPart(e)) continue;
    ++num;
    const double error = fit->ErrorOf(e).norm();
    if (error <= largest) continue;
    worst = e;
    if (!std::isfinite(error)) break;
    largest = error;
  }
  if (num < 2 || !worst) return false;
  fit->Remove(*worst);
  return true;
}

}  // namespace

std::vector<std::vector<int64_t>> JoinMatches(
    const std::vector<std::pair<int64_t, int64_t>>& edges,
    std::vector<char>* is_open) {
  const auto num = static_cast<int64_t>(is_open->size());
  DisjointSets joined(num);
  std::vector<char> is_joined(num, 0);
  for (const auto& [a, b] : edges) {
    if (!(*is_open)[a] || !(*is_open)[b]) continue;
    joined.Unite(a, b);
    is_joined[a] = is_joined[b] = 1;
  }
  std::vector<std::vector<int64_t>> components;
  std::vector<int64_t> of_root(num, -1);
  for (int64_t k = 0; k < num; ++k) {
    (*is_open)[k] = is_joined[k];
    if (!is_joined[k]) continue;
    int64_t& component = of_root[joined.Find(k)];
    if (component < 0) {
      component = static_cast<int64_t>(components.size());
      components.emplace_back();
    }
    components[component].push_back(k);
  }
  return components;
}

std::vector<Vector3d> RobustPlaces(const Model& model, double max_error_px,
                                   const Context& context) {
  BuildProblemOptions options;
  options.num_threads = context.num_threads;
  options.ignore_translations = true;
  const BuiltProblem built = BuildProblem(model, options);
  Estimate estimate = OwnEstimate(model, built);
  std::vector<int32_t> all(built.problem.num_points);
  std::iota(all.begin(), all.end(), 0);
  PlacePointsRobustly(built.problem, all, Norm::L2(), max_error_px, context,
                      &estimate);
  std::vector<Vector3d> places;
  for (const Point3D& point : model.points3D) places.push_back(point.xyz);
  for (const int32_t k : all) places[built.point_of[k]] = estimate.points[k];
  return places;
}

std::vector<FittedTrack> FitTracks(const Model& model, double max_error_px,
                                   const Context& context) {
  std::vector<FittedTrack> fitted(model.points3D.size());
  const std::vector<double> no_weights;
  TrackNoise fit(model, no_weights);
  ParallelFor(
      static_cast<int64_t>(fitted.size()), kTracksPerTask, context.num_threads,
      [&](int64_t begin, int64_t end, int /*worker*/) {
        for (int64_t n = begin; n < end; ++n) {
          const Point3D& point = model.points3D[n];
          for (bool has_changed = true; has_changed;) {
            fit.Fit(n);
            has_changed = RemoveWorst(point, max_error_px, &fit);
          }
          for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
            if (fit.TakesPart(e)) fitted[n].elements.push_back(e);
          }
          fitted[n].xyz = fit.Point(n);
        }
      });
  return fitted;
}

int64_t RemoveMoreThanNoise(const Context& context, Model* model) {
  const NoiseSnooping snooping = SnoopNoise(*model, {}, context);
  std::vector<char> is_removed(model->track_elements.size(), 0);
  for (const SnoopedObservation& one : snooping.removed) {
    if (!one.is_of_two) is_removed[one.element] = 1;
  }
  int64_t num_removed = 0;
  for (size_t k = 0; k < model->points3D.size(); ++k) {
    const Point3D& point = model->points3D[k];
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!is_removed[e]) continue;
      model->points3D[k].xyz = snooping.noise.points[k];
      ++num_removed;
    }
  }
  *model = RemoveObservations(*model, is_removed).model;
  return num_removed;
}

int64_t RemoveNarrow(double min_angle_deg, Model* model) {
  const double least = std::cos(min_angle_deg / kDegreesPerRadian);
  const std::vector<ImageGeometry> geometries = ImageGeometries(*model);
  const auto indices = ImageIndices(*model);
  std::vector<char> is_removed(model->track_elements.size(), 0);
  int64_t num_narrow = 0;
  for (const Point3D& point : model->points3D) {
    std::vector<Vector3d> rays;
    bool is_narrow = true;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const int32_t image = indices.at(model->track_elements[e].image_id);
      const Vector3d center = Center(geometries[image].cam_from_world);
      rays.push_back((point.xyz - center).normalized());
      for (const Vector3d& other : rays) {
        is_narrow = is_narrow && other.dot(rays.back()) > least;
      }
    }
    if (!is_narrow) continue;
    ++num_narrow;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      is_removed[e] = 1;
    }
  }
  *model = RemoveObservations(*model, is_removed).model;
  return num_narrow;
}

}  // namespace krot::internal
