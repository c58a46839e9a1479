#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "krot/context.h"
#include "krot/model.h"

namespace krot::internal {

// What TriangulateMatches does with tracks that are given. Internal to it.

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

// Removes what is more than noise (SnoopNoise), but not of a track of two, of
// which it cannot be told which one is wrong. Returns the number.
int64_t RemoveMoreThanNoise(const Context& context, Model* model);

// Removes points all of whose rays are within the angle. Returns the number.
int64_t RemoveNarrow(double min_angle_deg, Model* model);

}  // namespace krot::internal
