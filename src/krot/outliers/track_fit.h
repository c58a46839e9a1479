#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/context.h"
#include "krot/database.h"
#include "krot/model.h"

namespace krot::internal {

// What TriangulateMatches does with tracks that are given. Internal to it.

struct MatchTrack {
  std::vector<int64_t> keypoints;  // KeypointNumbers, ascending
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
};

// Keypoints of all images, numbered one image after the other.
class KeypointNumbers {
 public:
  KeypointNumbers() = default;
  explicit KeypointNumbers(const Model& model);

  // Of the first keypoint of Model::images[image]; behind the last image the
  // number of all.
  int64_t First(int64_t image) const { return begin_[image]; }
  int64_t size() const { return begin_.back(); }
  int32_t ImageOf(int64_t keypoint) const;

  bool HasImageTwice(const MatchTrack& track) const;
  // Which of an image's keypoints is right cannot be told: none stays.
  void LeaveOutTwins(MatchTrack* track) const;
  // A copy of a model without tracks that has these.
  Model ModelWith(const std::vector<MatchTrack>& tracks, Model model) const;

 private:
  std::vector<int64_t> begin_ = {0};
};

// Takes the model's tracks and points from it, and gives its images the
// database's keypoints as 2D points. Throws ModelError if tracks are to be kept
// whose 2D points are others.
void TakeKeypointsOf(const Database& database, bool keeps_tracks, Model* model);

// What matches (`edges`) join of the keypoints that are open, ascending, in the
// order of their first ones; those that nothing joins are closed.
std::vector<std::vector<int64_t>> JoinMatches(
    const std::vector<std::pair<int64_t, int64_t>>& edges,
    std::vector<char>* is_open);

// Of each point a place that most of its track agrees with, whatever the others
// are (PlacePointsRobustly); where the point is if there is none.
std::vector<Eigen::Vector3d> RobustPlaces(const Model& model,
                                          double max_error_px,
                                          const Context& context);

struct FittedTrack {
  std::vector<uint64_t> elements;  // that are left, in Model::track_elements
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
};

// Each point at the least squares of its track; observations that are then
// above the bound go, the worst first.
std::vector<FittedTrack> FitTracks(const Model& model, double max_error_px,
                                   const Context& context);

// Removes points all of whose rays are within the angle. Returns the number.
int64_t RemoveNarrow(double min_angle_deg, Model* model);

}  // namespace krot::internal
