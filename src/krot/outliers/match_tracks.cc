#include "krot/outliers/match_tracks.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "krot/analysis/epipolar_match.h"
#include "krot/base/check.h"
#include "krot/base/parallel_for.h"
#include "krot/bridge/bridge.h"
#include "krot/bridge/point_repair.h"
#include "krot/model.h"
#include "krot/model/image_geometry.h"
#include "krot/outliers/track_fit.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// COLMAP's mapper uses no pair with fewer (Mapper.min_num_matches).
constexpr int64_t kMinMatchesOfPair = 15;

// Keypoints of all images, numbered one image after the other, and where their
// point is.
struct MatchTrack {
  std::vector<int64_t> keypoints;  // ascending
  Vector3d xyz = Vector3d::Zero();
};

class MatchTriangulator {
 public:
  MatchTriangulator(const Model& model, const Database& database,
                    const MatchTracksOptions& options, const Context& context)
      : database_(database),
        options_(options),
        context_(context),
        model_(model),
        geometries_(ImageGeometries(model)) {}

  MatchTracksResult Run() {
    TakeKeypoints();
    JoinTracks();
    AddMatches();
    std::vector<MatchTrack> open = Components();
    summary_.num_components = static_cast<int64_t>(open.size());
    for (const MatchTrack& track : open) {
      if (HasImageTwice(track)) ++summary_.num_image_twice;
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
  int32_t ImageOf(int64_t keypoint) const {
    return static_cast<int32_t>(
        std::upper_bound(begin_.begin(), begin_.end(), keypoint) -
        begin_.begin() - 1);
  }
  uint32_t IndexOf(int64_t keypoint) const {
    return static_cast<uint32_t>(keypoint - begin_[ImageOf(keypoint)]);
  }

  // Moves the tracks out of the model.
  void TakeKeypoints() {
    points3D_ = std::move(model_.points3D);
    elements_ = std::move(model_.track_elements);
    model_.points3D.clear();
    model_.track_elements.clear();
    begin_ = {0};
    for (size_t i = 0; i < model_.images.size(); ++i) {
      Image& image = model_.images[i];
      const auto& keypoints = database_.keypoints[i];
      bool is_same = keypoints.size() == image.points2D.size();
      bool has_track = false;
      for (size_t k = 0; k < image.points2D.size(); ++k) {
        Point2D& point = image.points2D[k];
        is_same = is_same && keypoints[k] == Eigen::Vector2d(point.x, point.y);
        has_track = has_track || point.point3D_id != kInvalidPoint3DId;
        point.point3D_id = kInvalidPoint3DId;
      }
      if (!is_same && !keypoints.empty()) {
        if (has_track && options_.keeps_tracks) {
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
      begin_.push_back(begin_.back() +
                       static_cast<int64_t>(image.points2D.size()));
    }
    is_open_.assign(begin_.back(), 0);
    num_matches_.assign(begin_.back(), 0);
    rays_.resize(begin_.back());
    ParallelFor(static_cast<int64_t>(model_.images.size()), 1,
                context_.num_threads,
                [&](int64_t begin, int64_t end, int /*worker*/) {
                  for (int64_t i = begin; i < end; ++i) TakeRays(i);
                });
  }

  void TakeRays(int64_t i) {
    const ImageGeometry& geometry = geometries_[i];
    if (!geometry.has_pose) return;
    const Eigen::Matrix3d world_from_cam =
        geometry.cam_from_world.rotation.transpose();
    for (int64_t k = begin_[i]; k < begin_[i + 1]; ++k) {
      const Point2D& point = model_.images[i].points2D[k - begin_[i]];
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
        return begin_[indices.at(elements_[e].image_id)] +
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
                [&](int64_t begin, int64_t end, int /*worker*/) {
                  for (int64_t p = begin; p < end; ++p) {
                    agreeing[p] = Agreeing(database_.pairs[p]);
                  }
                });
    for (int64_t p = 0; p < num_pairs; ++p) {
      const VerifiedPair& pair = database_.pairs[p];
      const auto num_matches = static_cast<int64_t>(pair.matches.size());
      const auto num_agreeing = static_cast<int64_t>(agreeing[p].size());
      if (num_matches < kMinMatchesOfPair ||
          !geometries_[pair.image1].has_pose ||
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
        ++num_matches_[begin_[pair.image1] + k1];
        ++num_matches_[begin_[pair.image2] + k2];
      }
      edges_.insert(edges_.end(), agreeing[p].begin(), agreeing[p].end());
    }
  }

  std::vector<std::pair<int64_t, int64_t>> Agreeing(
      const VerifiedPair& pair) const {
    std::vector<std::pair<int64_t, int64_t>> agreeing;
    const Vector3d baseline = Center(geometries_[pair.image2].cam_from_world) -
                              Center(geometries_[pair.image1].cam_from_world);
    for (const auto& [k1, k2] : pair.matches) {
      const int64_t a = begin_[pair.image1] + k1, b = begin_[pair.image2] + k2;
      if (!is_open_[a] || !is_open_[b]) continue;
      const double error = EpipolarMatch(rays_[a], rays_[b]).ErrorPx(baseline);
      if (error <= std::sqrt(2) * options_.max_error_px) {
        agreeing.emplace_back(a, b);
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

  bool HasImageTwice(const MatchTrack& track) const {
    for (size_t n = 1; n < track.keypoints.size(); ++n) {
      if (ImageOf(track.keypoints[n - 1]) == ImageOf(track.keypoints[n])) {
        return true;
      }
    }
    return false;
  }

  // The model with these tracks.
  Model ModelWith(const std::vector<MatchTrack>& tracks) const {
    Model model = model_;
    for (size_t n = 0; n < tracks.size(); ++n) {
      Point3D& point = model.points3D.emplace_back();
      point.id = n + 1;
      point.xyz = tracks[n].xyz;
      point.track_begin = model.track_elements.size();
      for (const int64_t k : tracks[n].keypoints) {
        Image& image = model.images[ImageOf(k)];
        model.track_elements.push_back({image.id, IndexOf(k)});
        image.points2D[IndexOf(k)].point3D_id = point.id;
      }
      point.track_end = model.track_elements.size();
    }
    return model;
  }

  // Takes out what belongs to one point and closes it, and what belongs to
  // none. What is left is open.
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
      if (is_within && !HasImageTwice(tracks[n])) {
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

  // Each track's l-infinity intersection.
  void Intersect(std::vector<MatchTrack>* tracks) const {
    for (MatchTrack& track : *tracks) {
      std::vector<Ray> rays;
      for (const int64_t k : track.keypoints) {
        rays.push_back({Center(geometries_[ImageOf(k)].cam_from_world),
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

  // Of each of `tracks` what is within the bound where `places` has its point,
  // of every image the nearest.
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
            !nearest.empty() && ImageOf(nearest.back()) == ImageOf(k);
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
    accepted_.erase(std::remove_if(accepted_.begin(), accepted_.end(),
                                   [](const MatchTrack& track) {
                                     return track.keypoints.size() < 2;
                                   }),
                    accepted_.end());
    std::sort(accepted_.begin(), accepted_.end(),
              [](const MatchTrack& a, const MatchTrack& b) {
                return a.keypoints < b.keypoints;
              });
    model_ = ModelWith(accepted_);
    summary_.num_more_than_noise = RemoveMoreThanNoise(context_, &model_);
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
  // Of each of Model::images the number of its first keypoint, and their count.
  std::vector<int64_t> begin_;
  std::vector<PixelRay> rays_;  // world axes
  // Of keypoints: has a ray and a pose and belongs to no point yet.
  std::vector<char> is_open_;
  std::vector<int32_t> num_matches_;  // of keypoints, agreeing or not
  std::vector<std::pair<int64_t, int64_t>> edges_;  // keypoints that match
  std::vector<MatchTrack> accepted_;
  MatchTracksSummary summary_;
};

}  // namespace

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
