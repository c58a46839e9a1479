#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "krot/analysis/noise.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/convert/build_problem.h"
#include "krot/finish/least_squares.h"
#include "krot/geometry.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"
#include "krot/outliers/match_tracks.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/outliers/robust_start.h"
#include "krot/problem/gauge.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// Removes the worst observation of a track of several, if it is above the bound
// or behind its camera. Returns whether it did.
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

KeypointNumbers::KeypointNumbers(const Model& model) {
  for (const Image& image : model.images) {
    begin_.push_back(begin_.back() +
                     static_cast<int64_t>(image.points2D.size()));
  }
}

int32_t KeypointNumbers::ImageOf(int64_t keypoint) const {
  return static_cast<int32_t>(
      std::upper_bound(begin_.begin(), begin_.end(), keypoint) -
      begin_.begin() - 1);
}

bool KeypointNumbers::HasImageTwice(const MatchTrack& track) const {
  for (size_t n = 1; n < track.keypoints.size(); ++n) {
    if (ImageOf(track.keypoints[n - 1]) == ImageOf(track.keypoints[n])) {
      return true;
    }
  }
  return false;
}

void KeypointNumbers::LeaveOutTwins(MatchTrack* track) const {
  const std::vector<int64_t> all = std::move(track->keypoints);
  track->keypoints.clear();
  for (size_t n = 0; n < all.size(); ++n) {
    const int32_t image = ImageOf(all[n]);
    if ((n > 0 && ImageOf(all[n - 1]) == image) ||
        (n + 1 < all.size() && ImageOf(all[n + 1]) == image)) {
      continue;
    }
    track->keypoints.push_back(all[n]);
  }
}

Model KeypointNumbers::ModelWith(const std::vector<MatchTrack>& tracks,
                                 Model model) const {
  for (size_t n = 0; n < tracks.size(); ++n) {
    Point3D& point = model.points3D.emplace_back();
    point.id = n + 1;
    point.xyz = tracks[n].xyz;
    point.track_begin = model.track_elements.size();
    for (const int64_t k : tracks[n].keypoints) {
      const int32_t i = ImageOf(k);
      const auto index = static_cast<uint32_t>(k - First(i));
      Image& image = model.images[i];
      model.track_elements.push_back({image.id, index});
      image.points2D[index].point3D_id = point.id;
    }
    point.track_end = model.track_elements.size();
  }
  return model;
}

void TakeKeypointsOf(const Database& database, bool keeps_tracks,
                     Model* model) {
  model->points3D.clear();
  model->track_elements.clear();
  for (size_t i = 0; i < model->images.size(); ++i) {
    Image& image = model->images[i];
    const auto& keypoints = database.keypoints[i];
    bool is_same = keypoints.size() == image.points2D.size();
    bool has_track = false;
    for (size_t k = 0; k < image.points2D.size(); ++k) {
      Point2D& point = image.points2D[k];
      is_same = is_same && keypoints[k] == Eigen::Vector2d(point.x, point.y);
      has_track = has_track || point.point3D_id != kInvalidPoint3DId;
      point.point3D_id = kInvalidPoint3DId;
    }
    if (is_same || keypoints.empty()) continue;
    if (has_track && keeps_tracks) {
      throw ModelError("image \"" + image.name +
                       "\": its 2D points are not the keypoints of the "
                       "database one by one, so that its tracks cannot be "
                       "kept; --clear_points 1 makes new ones");
    }
    image.points2D.clear();
    for (const Eigen::Vector2d& keypoint : keypoints) {
      image.points2D.push_back({keypoint.x(), keypoint.y()});
    }
  }
}

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
  const std::vector<int32_t> all = AllPoints(built.problem);
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
  ParallelForEach(
      static_cast<int64_t>(fitted.size()), context.num_threads, [&](int64_t n) {
        const Point3D& point = model.points3D[n];
        do {
          fit.Fit(n);
        } while (RemoveWorst(point, max_error_px, &fit));
        for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
          if (fit.TakesPart(e)) fitted[n].elements.push_back(e);
        }
        fitted[n].xyz = fit.Point(n);
      });
  return fitted;
}

int64_t RemoveNarrow(double min_angle_deg, Model* model) {
  const double least = std::cos(min_angle_deg / kDegreesPerRadian);
  const std::vector<ImageGeometry> geometries = ImageGeometries(*model);
  const std::vector<int32_t> image_of = ImagesOfElements(*model);
  std::vector<char> is_removed(model->track_elements.size(), 0);
  int64_t num_narrow = 0;
  for (const Point3D& point : model->points3D) {
    std::vector<Vector3d> rays;
    bool is_narrow = true;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const Vector3d center = Center(geometries[image_of[e]].cam_from_world);
      rays.push_back((point.xyz - center).normalized());
      for (const Vector3d& other : rays) {
        is_narrow = is_narrow && other.dot(rays.back()) > least;
      }
    }
    if (!is_narrow) continue;
    ++num_narrow;
    std::fill(is_removed.begin() + point.track_begin,
              is_removed.begin() + point.track_end, 1);
  }
  *model = RemoveObservations(*model, is_removed).model;
  return num_narrow;
}

namespace {

// A copy without positions.
Model RotationsOf(const Model& model) {
  Model rotations = model;
  for (Frame& frame : rotations.frames) {
    if (!HasRotation(frame.rig_from_world.quaternion_wxyz)) continue;
    frame.rig_from_world.translation.setZero();
  }
  return rotations;
}

// The model with the estimate's frames and points, moved to its own place and
// scale.
Model PosesAt(const Model& model, const BuiltProblem& built, Estimate estimate,
              const Context& context) {
  RestoreGaugeIfHarmless(built.problem, OwnEstimate(model, built), Norm::L2(),
                         context, &estimate);
  return ApplyEstimate(model, built, estimate);
}

PlacedMatches PlaceInFrame(const Model& poses, const Database& database,
                           const MatchTracksOptions& options,
                           const Context& context) {
  PlacedMatches placed;
  OutlierFilterOptions from_nothing;
  from_nothing.max_error = options.max_error_px;
  from_nothing.solve.init = SolveInit::kFeasible;
  context.Stage("baselines of " + std::to_string(database.pairs.size()) +
                " pairs");
  // Notes about what these steps leave out are not for the user.
  Context quiet = context;
  quiet.on_note = {};
  const Model rotations = RotationsOf(poses);
  Model tracks =
      TracksFromRotations(rotations, database, options.max_error_px, context);
  for (size_t f = 0; f < poses.frames.size(); ++f) {
    tracks.frames[f].rig_from_world = poses.frames[f].rig_from_world;
  }
  if (tracks.points3D.empty()) return {poses, {}, 0};
  RemovalStart start = FindRemovalStart(tracks, from_nothing, context);
  const std::set<int32_t> held(start.built.image_of.begin(),
                               start.built.image_of.end());
  const std::vector<ImageGeometry> geometries = ImageGeometries(rotations);
  for (size_t i = 0; i < geometries.size(); ++i) {
    placed.num_unplaced +=
        geometries[i].has_pose && held.count(static_cast<int32_t>(i)) == 0;
  }
  placed.model = PosesAt(tracks, start.built, start.built.start, context);
  // The first triangulation divides tracks by the robust start's positions, the
  // second one by positions that fit the first one's tracks.
  for (const bool is_last : {false, true}) {
    if (context.IsCancelled()) break;
    MatchTracksResult made =
        TriangulateMatches(placed.model, database, options, quiet);
    placed.summary = made.summary;
    placed.model = std::move(made.model);
    if (is_last || placed.model.points3D.empty()) break;
    const BuiltProblem built = BuildProblem(placed.model, {});
    Estimate estimate = built.start;
    MinimizeRobustly(built.problem, context, &estimate);
    placed.model = PosesAt(placed.model, built, std::move(estimate), context);
  }
  return placed;
}

}  // namespace

PlacedMatches PlaceMatches(const Model& model, const Database& database,
                           const MatchTracksOptions& options,
                           const Context& context) {
  Model poses = model;
  poses.points3D.clear();
  poses.track_elements.clear();
  for (Image& image : poses.images) {
    for (Point2D& point : image.points2D) point.point3D_id = kInvalidPoint3DId;
  }
  return InLocalFrame(LocalFrame(poses), poses, [&](const Model& local) {
    return PlaceInFrame(local, database, options, context);
  });
}

}  // namespace krot::internal
