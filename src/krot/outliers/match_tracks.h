#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/context.h"
#include "krot/database.h"
#include "krot/model.h"

namespace krot::internal {

// Points for a model whose poses are known, from the verified matches of a
// database.

struct MatchTracksOptions {
  double max_error_px = 4;  // of an observation; > 0
  double min_angle_deg =
      1.5;  // the largest between two of a point's rays; >= 0
  // Whether the model's own tracks count as matches; else they are ignored.
  bool keeps_tracks = false;
};

struct MatchTracksSummary {
  int64_t num_pairs = 0;                // whose matches are used
  int64_t num_contradictory_pairs = 0;  // fewer than a quarter of matches agree
  int64_t num_matches = 0;              // of the pairs used
  int64_t num_disagreeing = 0;  // of these, no point is within max_error_px
  int64_t num_components = 0;   // sets of keypoints that matches join
  int64_t num_image_twice = 0;  // of these, with two keypoints of an image
  int64_t num_in_conflict = 0;  // tracks that no point fits; also joined anew
  int64_t num_two_views = 0;    // points left out, seen by one match alone
  int64_t num_narrow = 0;       // points left out, below min_angle_deg
};

struct MatchTracksResult {
  Model model;
  MatchTracksSummary summary;
};

// Makes points from matches, as COLMAP's point_triangulator does. Images whose
// 2D points are not the database's keypoints get these. Pairs of images need 15
// matches, a quarter of which agree. A match is dropped if its pixels must move
// together by more than sqrt(2) max_error_px to lie on their epipolar lines:
// then no point is within max_error_px of both. The others join keypoints to
// tracks. A track that sees no image twice is kept whole if its l-infinity
// intersection is within max_error_px of all its keypoints. Otherwise the point
// that most of it agrees with is found (PlacePointsRobustly); of every image
// the nearest keypoint within max_error_px of that point is taken, and the rest
// is joined anew. Each point then moves to the least squares of its track, and
// observations above max_error_px there go. Two keypoints that match only each
// other are left out, since nothing checks them.
//
// Throws std::invalid_argument for options out of range, ModelError for cameras
// without an image plane. Requires a valid model; ids of points are
// new, their colours black. The same bits at any number of threads.
// O(matches), some microseconds each.
MatchTracksResult TriangulateMatches(const Model& model,
                                     const Database& database,
                                     const MatchTracksOptions& options,
                                     const Context& context);

// Makes tracks for a model whose rotations and rigs alone are known; its
// positions only have to be finite. A match counts if it agrees with the
// baseline that most matches of its pair agree with (SearchBaseline). If a
// track has several keypoints of an image, these are left out. Points stay at
// the origin. Otherwise as TriangulateMatches.
Model TracksFromRotations(const Model& model, const Database& database,
                          double max_error_px, const Context& context);

struct PlacedMatches {
  Model model;  // without points where there is nothing to make them from
  MatchTracksSummary summary;  // of the last triangulation
  int64_t num_unplaced = 0;    // images with rotations, but without a track
};

// Positions and points from rotations and matches alone. The tracks of the
// rotations (TracksFromRotations) get a robust start (FindRobustStart). Its
// positions serve TriangulateMatches, whose tracks move to their robust least
// squares; with these positions TriangulateMatches runs again, because it
// divides tracks and drops wrong matches better the better the positions are.
// Place and scale are the model's where it has positions. Images without a
// track stay where they are. Requires and throws what TriangulateMatches does,
// with keeps_tracks false. The same bits at any number of threads.
PlacedMatches PlaceMatches(const Model& model, const Database& database,
                           const MatchTracksOptions& options,
                           const Context& context);

// Steps of TriangulateMatches, internal to it.

struct MatchTrack {
  std::vector<int64_t> keypoints;  // KeypointNumbers, ascending
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
};

// Keypoints of all images, numbered one image after the other.
class KeypointNumbers {
 public:
  KeypointNumbers() = default;
  explicit KeypointNumbers(const Model& model);

  // The number of the first keypoint of Model::images[image]; behind the last
  // image the number of all keypoints.
  int64_t First(int64_t image) const { return begin_[image]; }
  int64_t size() const { return begin_.back(); }
  int32_t ImageOf(int64_t keypoint) const;

  bool HasImageTwice(const MatchTrack& track) const;
  // Drops all keypoints of an image that has several, as the right one is
  // unknown.
  void LeaveOutTwins(MatchTrack* track) const;
  // A copy of `model`, which must have no tracks, with these.
  Model ModelWith(const std::vector<MatchTrack>& tracks, Model model) const;

 private:
  std::vector<int64_t> begin_ = {0};
};

// Removes the model's tracks and points, and gives its images the database's
// keypoints as 2D points. Throws ModelError if tracks are to be kept, but an
// image with tracks has other 2D points than the database.
void TakeKeypointsOf(const Database& database, bool keeps_tracks, Model* model);

// The sets of open keypoints that matches (`edges`) join: each ascending, in
// the order of their first keypoints. Open keypoints that nothing joins are
// closed.
std::vector<std::vector<int64_t>> JoinMatches(
    const std::vector<std::pair<int64_t, int64_t>>& edges,
    std::vector<char>* is_open);

// For each point a place that most of its track agrees with, however far off
// the others are (PlacePointsRobustly); the point's own place if there is none.
std::vector<Eigen::Vector3d> RobustPlaces(const Model& model,
                                          double max_error_px,
                                          const Context& context);

struct FittedTrack {
  std::vector<uint64_t> elements;  // what is left, in Model::track_elements
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
};

// Moves each point to the least squares of its track. As long as observations
// are above the bound there, the worst one goes, and the point is fitted again.
std::vector<FittedTrack> FitTracks(const Model& model, double max_error_px,
                                   const Context& context);

// Removes points whose rays are all within this angle. Returns how many.
int64_t RemoveNarrow(double min_angle_deg, Model* model);

}  // namespace krot::internal
