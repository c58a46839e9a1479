#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <numeric>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/convert/build_problem.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Indices of the records by their ids, which differ: the order in which a file
// happens to hold them makes no difference to a result.
template <typename Record>
std::vector<int32_t> OrderOfIds(const std::vector<Record>& records) {
  std::vector<int32_t> order(records.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int32_t a, int32_t b) {
    return records[a].id < records[b].id;
  });
  return order;
}

// Numbers the frames that have observations, and their images as views, of a
// problem whose observations name their image as `view`; they name the view
// from now on.
void AddFramesAndViews(const Model& model,
                       const std::vector<ImageGeometry>& geometries,
                       Ranks* ranks, BuiltProblem* built);

// Fixes what is marked of the model where the problem starts.
void FixPositions(const FixedParts& fixed, BuiltProblem* built);

// Observations of one image in the same track: of a point that was matched to
// two places of an image one is wrong, or both are.

// Whether two of a point's observations are of one image. O(count^2).
bool HasImageTwice(const Observation* observations, int count);

// For each of a point's observations, whether no other of its image has a
// smaller error at `xyz`, or the same and comes first. Rows are taken there;
// `view` is the index of the image in `images`. O(count^2).
std::vector<char> ClosestOfImages(const std::vector<ImageGeometry>& images,
                                  const Observation* observations, int count,
                                  const Eigen::Vector3d& xyz);

// The part that a track element has in a built problem.
enum class Role : char {
  kOut,   // none
  kIn,    // it is an observation of the problem
  kTwin,  // none, but another of its image and track is, which kClosest prefers
};

// One for each of the model's track elements, of a problem that was built with
// `same_image`. O(observations).
std::vector<Role> RolesOf(const Model& model, const BuiltProblem& built,
                          SameImage same_image);

// The half-line from a camera's centre through an observation, in the world.
struct Ray {
  Eigen::Vector3d centre;
  Eigen::Vector3d direction;  // of unit length
};

// The point whose squared distances to the rays' lines sum to the least: the
// x of sum_i (I - d_i d_i') (x - C_i) = 0. None if the lines are parallel up
// to rounding. O(rays).
std::optional<Eigen::Vector3d> RetriangulateMidpoint(
    const std::vector<Ray>& rays);

// Points that their images see, or brought there.

struct RepairedPoint {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  bool is_retriangulated = false;
};

// Leaves the point where it is if all its images see it, or if re-triangulation
// from all its rays (where v = 0) does not lower the number of those that do
// not; `is_seen` tells for the i-th observation and a position. Requires that
// the observations have poses and that their `view` is the image's index in
// `images`. O(count); allocates only if an image does not see it.
RepairedPoint RepairPoint(
    const std::vector<ImageGeometry>& images, const Observation* observations,
    int count, const Eigen::Vector3d& xyz,
    const std::function<bool(int, const Eigen::Vector3d&)>& is_seen);

}  // namespace krot::internal
