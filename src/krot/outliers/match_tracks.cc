#include "krot/outliers/match_tracks.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "krot/analysis/epipolar.h"
#include "krot/base/check.h"
#include "krot/base/parallel_for.h"
#include "krot/convert/build_problem.h"
#include "krot/model.h"
#include "krot/model/rigs.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

void EraseShort(std::vector<MatchTrack>* tracks) {
  tracks->erase(std::remove_if(tracks->begin(), tracks->end(),
                               [](const MatchTrack& track) {
                                 return track.keypoints.size() < 2;
                               }),
                tracks->end());
}

class MatchTriangulator {
 public:
  MatchTriangulator(const Model& model, const Database& database,
                    const MatchTracksOptions& options, const Context& context)
      : database_(database),
        options_(options),
        context_(context),
        model_(model),
        geometries_(ImageGeometries(model)) {}

  // Makes tracks where no positions are known.
  Model RunOnRotations() {
    has_positions_ = false;
    TakeKeypoints();
    AddMatches();
    std::vector<MatchTrack> tracks = Components();
    for (MatchTrack& track : tracks) numbers_.LeaveOutTwins(&track);
    EraseShort(&tracks);
    return ModelWith(tracks);
  }

  MatchTracksResult Run() {
    TakeKeypoints();
    JoinTracks();
    AddMatches();
    std::vector<MatchTrack> open = Components();
    summary_.num_components = static_cast<int64_t>(open.size());
    for (const MatchTrack& track : open) {
      if (numbers_.HasImageTwice(track)) ++summary_.num_image_twice;
    }
    LeaveOutSingleMatches(&open);
    context_.Stage("intersecting " + std::to_string(open.size()) + " tracks");
    while (!open.empty() && !context_.IsCancelled()) {
      Divide(std::move(open));
      open = Components();
    }
    Finish();
    return {std::move(model_), summary_};
  }

 private:
  // Moves the tracks out of the model, and finds the keypoints' rays.
  void TakeKeypoints() {
    points3D_ = std::move(model_.points3D);
    elements_ = std::move(model_.track_elements);
    TakeKeypointsOf(database_, options_.keeps_tracks, &model_);
    numbers_ = KeypointNumbers(model_);
    is_open_.assign(numbers_.size(), 0);
    num_matches_.assign(numbers_.size(), 0);
    rays_.resize(numbers_.size());
    ParallelFor(static_cast<int64_t>(model_.images.size()), 1,
                context_.num_threads,
                [&](int64_t i, int64_t, int) { TakeRays(i); });
  }

  void TakeRays(int64_t i) {
    const ImageGeometry& geometry = geometries_[i];
    if (!geometry.has_pose) return;
    const Eigen::Matrix3d world_from_cam =
        geometry.cam_from_world.rotation.transpose();
    const int64_t first = numbers_.First(i);
    for (int64_t k = first; k < numbers_.First(i + 1); ++k) {
      const Point2D& point = model_.images[i].points2D[k - first];
      const auto ray =
          RayOf(model_.cameras[geometry.camera], {point.x, point.y});
      if (!ray) continue;
      rays_[k] = world_from_cam * *ray;
      is_open_[k] = 1;
    }
  }

  // The model's own tracks, if they are to be kept.
  void JoinTracks() {
    if (!options_.keeps_tracks) return;
    const auto indices = ImageIndices(model_);
    for (const Point3D& point : points3D_) {
      const auto keypoint = [&](uint64_t e) {
        return numbers_.First(indices.at(elements_[e].image_id)) +
               elements_[e].point2D_idx;
      };
      for (uint64_t e = point.track_begin + 1; e < point.track_end; ++e) {
        edges_.emplace_back(keypoint(e - 1), keypoint(e));
        ++num_matches_[keypoint(e - 1)];
        ++num_matches_[keypoint(e)];
      }
    }
  }

  void AddMatches() {
    const auto num_pairs = static_cast<int64_t>(database_.pairs.size());
    std::vector<std::vector<std::pair<int64_t, int64_t>>> agreeing(num_pairs);
    ParallelFor(num_pairs, 1, context_.num_threads,
                [&](int64_t p, int64_t, int) {
                  agreeing[p] = Agreeing(database_.pairs[p]);
                });
    for (int64_t p = 0; p < num_pairs; ++p) {
      const VerifiedPair& pair = database_.pairs[p];
      const auto num_matches = static_cast<int64_t>(pair.matches.size());
      const auto num_agreeing = static_cast<int64_t>(agreeing[p].size());
      // COLMAP's mapper uses no pair with fewer (Mapper.min_num_matches).
      if (num_matches < 15 || !geometries_[pair.image1].has_pose ||
          !geometries_[pair.image2].has_pose) {
        continue;
      }
      if (4 * num_agreeing < num_matches) {
        ++summary_.num_contradictory_pairs;
        continue;
      }
      ++summary_.num_pairs;
      summary_.num_matches += num_matches;
      summary_.num_disagreeing += num_matches - num_agreeing;
      for (const auto& [k1, k2] : pair.matches) {
        ++num_matches_[numbers_.First(pair.image1) + k1];
        ++num_matches_[numbers_.First(pair.image2) + k2];
      }
      edges_.insert(edges_.end(), agreeing[p].begin(), agreeing[p].end());
    }
  }

  std::vector<std::pair<int64_t, int64_t>> Agreeing(
      const VerifiedPair& pair) const {
    const double tolerance = std::sqrt(2) * options_.max_error_px;
    std::vector<std::pair<int64_t, int64_t>> keypoints, agreeing;
    std::vector<EpipolarMatch> matches;
    for (const auto& [k1, k2] : pair.matches) {
      const int64_t a = numbers_.First(pair.image1) + k1,
                    b = numbers_.First(pair.image2) + k2;
      if (!is_open_[a] || !is_open_[b]) continue;
      keypoints.emplace_back(a, b);
      matches.emplace_back(rays_[a], rays_[b]);
    }
    const Vector3d baseline =
        has_positions_
            ? Vector3d(Center(geometries_[pair.image2].cam_from_world) -
                       Center(geometries_[pair.image1].cam_from_world))
            : SearchBaseline(matches, tolerance, /*max_cells=*/1000).baseline;
    for (size_t n = 0; n < matches.size(); ++n) {
      if (matches[n].ErrorPx(baseline) <= tolerance) {
        agreeing.push_back(keypoints[n]);
      }
    }
    return agreeing;
  }

  std::vector<MatchTrack> Components() {
    std::vector<MatchTrack> components;
    for (std::vector<int64_t>& keypoints : JoinMatches(edges_, &is_open_)) {
      components.push_back({std::move(keypoints)});
    }
    return components;
  }

  void Close(const MatchTrack& track) {
    for (const int64_t k : track.keypoints) is_open_[k] = 0;
  }

  void LeaveOutSingleMatches(std::vector<MatchTrack>* tracks) {
    const auto kept = std::stable_partition(
        tracks->begin(), tracks->end(), [&](const MatchTrack& track) {
          return std::any_of(track.keypoints.begin(), track.keypoints.end(),
                             [&](int64_t k) { return num_matches_[k] > 1; });
        });
    for (auto track = kept; track != tracks->end(); ++track) Close(*track);
    summary_.num_two_views = tracks->end() - kept;
    tracks->erase(kept, tracks->end());
  }

  Model ModelWith(const std::vector<MatchTrack>& tracks) const {
    return numbers_.ModelWith(tracks, model_);
  }

  // Accepts every track, or the part of it, that belongs to one point. Tracks
  // without such a part are closed; what else is left stays open.
  void Divide(std::vector<MatchTrack> tracks) {
    Intersect(&tracks);
    const Model model = ModelWith(tracks);
    const std::vector<double> errors = PixelErrors(model, context_.num_threads);
    std::vector<MatchTrack> conflicts;
    for (size_t n = 0; n < tracks.size(); ++n) {
      const Point3D& point = model.points3D[n];
      const bool is_within = std::all_of(
          errors.begin() + static_cast<std::ptrdiff_t>(point.track_begin),
          errors.begin() + static_cast<std::ptrdiff_t>(point.track_end),
          [&](double error) { return error <= options_.max_error_px; });
      if (is_within && !numbers_.HasImageTwice(tracks[n])) {
        Accept(std::move(tracks[n]));
      } else {
        if (!is_within) ++summary_.num_in_conflict;
        conflicts.push_back(std::move(tracks[n]));
      }
    }
    PlaceRobustly(&conflicts);
    std::vector<MatchTrack> parts = NearestOf(conflicts, conflicts);
    LeastSquares(&parts);
    parts = NearestOf(conflicts, parts);
    for (size_t n = 0; n < conflicts.size(); ++n) {
      if (parts[n].keypoints.size() < 2) {
        Close(conflicts[n]);
      } else {
        Accept(std::move(parts[n]));
      }
    }
  }

  void Accept(MatchTrack track) {
    Close(track);
    accepted_.push_back(std::move(track));
  }

  // Moves each track's point to its l-infinity intersection.
  void Intersect(std::vector<MatchTrack>* tracks) const {
    for (MatchTrack& track : *tracks) {
      std::vector<Ray> rays;
      for (const int64_t k : track.keypoints) {
        rays.push_back({Center(geometries_[numbers_.ImageOf(k)].cam_from_world),
                        rays_[k].ray.normalized()});
      }
      track.xyz = RetriangulateMidpoint(rays).value_or(rays[0].centre);
    }
    const Model model =
        TriangulateModel(ModelWith(*tracks), {}, context_).model;
    for (size_t n = 0; n < tracks->size(); ++n) {
      (*tracks)[n].xyz = model.points3D[n].xyz;
    }
  }

  void PlaceRobustly(std::vector<MatchTrack>* tracks) const {
    if (tracks->empty()) return;
    const std::vector<Vector3d> places =
        RobustPlaces(ModelWith(*tracks), options_.max_error_px, context_);
    for (size_t n = 0; n < places.size(); ++n) (*tracks)[n].xyz = places[n];
  }

  void LeastSquares(std::vector<MatchTrack>* tracks) const {
    const Model model = ModelWith(*tracks);
    const std::vector<FittedTrack> fitted =
        FitTracks(model, options_.max_error_px, context_);
    for (size_t n = 0; n < fitted.size(); ++n) {
      MatchTrack& track = (*tracks)[n];
      std::vector<int64_t> kept;
      for (const uint64_t e : fitted[n].elements) {
        kept.push_back(track.keypoints[e - model.points3D[n].track_begin]);
      }
      track.keypoints = std::move(kept);
      track.xyz = fitted[n].xyz;
    }
  }

  // Of each of `tracks` the keypoints within the bound of the point in
  // `places`, of every image only the nearest.
  std::vector<MatchTrack> NearestOf(
      std::vector<MatchTrack> tracks,
      const std::vector<MatchTrack>& places) const {
    for (size_t n = 0; n < tracks.size(); ++n) tracks[n].xyz = places[n].xyz;
    const Model model = ModelWith(tracks);
    const std::vector<double> errors = PixelErrors(model, context_.num_threads);
    for (size_t n = 0; n < tracks.size(); ++n) {
      const double* error = &errors[model.points3D[n].track_begin];
      std::vector<int64_t> nearest;
      double lowest = 0;
      for (const int64_t k : tracks[n].keypoints) {
        const double here = *error++;
        if (!(here <= options_.max_error_px)) continue;
        const bool is_twin =
            !nearest.empty() &&
            numbers_.ImageOf(nearest.back()) == numbers_.ImageOf(k);
        if (is_twin && here >= lowest) continue;
        if (is_twin) nearest.pop_back();
        nearest.push_back(k);
        lowest = here;
      }
      tracks[n].keypoints = std::move(nearest);
    }
    return tracks;
  }

  void Finish() {
    LeastSquares(&accepted_);
    EraseShort(&accepted_);
    std::sort(accepted_.begin(), accepted_.end(),
              [](const MatchTrack& a, const MatchTrack& b) {
                return a.keypoints < b.keypoints;
              });
    model_ = ModelWith(accepted_);
    summary_.num_narrow = RemoveNarrow(options_.min_angle_deg, &model_);
    UpdatePointErrors(PixelErrors(model_, context_.num_threads), &model_);
  }

  const Database& database_;
  const MatchTracksOptions& options_;
  const Context& context_;
  Model model_;  // without tracks until the end
  const std::vector<ImageGeometry> geometries_;
  std::vector<Point3D> points3D_;  // the model's own
  std::vector<TrackElement> elements_;
  KeypointNumbers numbers_;
  std::vector<PixelRay> rays_;  // world axes
  // Per keypoint: it has a ray and a pose and belongs to no point yet.
  std::vector<char> is_open_;
  std::vector<int32_t> num_matches_;  // per keypoint, agreeing or not
  std::vector<std::pair<int64_t, int64_t>> edges_;  // keypoints that match
  std::vector<MatchTrack> accepted_;
  bool has_positions_ = true;
  MatchTracksSummary summary_;
};

}  // namespace

Model TracksFromRotations(const Model& model, const Database& database,
                          double max_error_px, const Context& context) {
  MatchTracksOptions options;
  options.max_error_px = max_error_px;
  return MatchTriangulator(model, database, options, context).RunOnRotations();
}

MatchTracksResult TriangulateMatches(const Model& model,
                                     const Database& database,
                                     const MatchTracksOptions& options,
                                     const Context& context) {
  CheckArgument(options.max_error_px > 0, "max_error_px", options.max_error_px,
                "positive");
  CheckArgument(options.min_angle_deg >= 0 && options.min_angle_deg < 180,
                "min_angle_deg", options.min_angle_deg, "in [0, 180)");
  return MatchTriangulator(model, database, options, context).Run();
}

}  // namespace krot::internal
