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

// Indices of the records in the order of their ids, which must be unique.
// Results that are computed in this order do not depend on the order in the
// file.
template <typename Record>
std::vector<int32_t> OrderOfIds(const std::vector<Record>& records) {
  std::vector<int32_t> order(records.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int32_t a, int32_t b) {
    return records[a].id < records[b].id;
  });
  return order;
}

// Numbers the frames that have observations, and their images as views. Before,
// the `view` of an observation is the index of its image in the model;
// afterwards it is that of the view.
void AddFramesAndViews(const Model& model,
                       const std::vector<ImageGeometry>& geometries,
                       Ranks* ranks, BuiltProblem* built);

// Fixes the marked parts of the model at their positions in the problem's
// start.
void FixPositions(const FixedParts& fixed, BuiltProblem* built);

// ---- Observations of one image in the same track ---- A point that was
// matched to two places of one image has at least one wrong observation.

// Whether two of a point's observations are from one image. O(count^2).
bool HasImageTwice(const Observation* observations, int count);

// For each of a point's observations, whether it has the smallest error at
// `xyz` among those of its image; the first one counts if several have the
// same. Requires rows that were taken there; `view` is the index of the image
// in `images`. O(count^2).
std::vector<char> ClosestOfImages(const std::vector<ImageGeometry>& images,
                                  const Observation* observations, int count,
                                  const Eigen::Vector3d& xyz);

// How a track element takes part in a built problem.
enum class Role : char {
  kOut,   // it takes no part
  kIn,    // it is an observation of the problem
  kTwin,  // it takes no part, because kClosest prefers another observation of
          // its image and track
};

// The role of each of the model's track elements in a problem that was built
// with `same_image`. O(observations).
std::vector<Role> RolesOf(const Model& model, const BuiltProblem& built,
                          SameImage same_image);

// The half-line from a camera's centre through an observation, in the world.
struct Ray {
  Eigen::Vector3d centre;
  Eigen::Vector3d direction;  // of unit length
};

// The point with the smallest sum of squared distances to the lines of the
// rays: the x of sum_i (I - d_i d_i') (x - C_i) = 0. None if the lines are
// parallel up to rounding. O(rays).
std::optional<Eigen::Vector3d> RetriangulateMidpoint(
    const std::vector<Ray>& rays);

// ---- Points behind their cameras ----

struct RepairedPoint {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  bool is_retriangulated = false;
};

// Keeps the point where it is if all its images see it, or if re-triangulation
// from all its rays (where v = 0) does not lower the number of images that do
// not. `is_seen` says whether the i-th observation sees a position. Requires
// observations with poses, whose `view` is the image's index in `images`.
// O(count); allocates only if some image does not see the point.
RepairedPoint RepairPoint(
    const std::vector<ImageGeometry>& images, const Observation* observations,
    int count, const Eigen::Vector3d& xyz,
    const std::function<bool(int, const Eigen::Vector3d&)>& is_seen);

}  // namespace krot::internal
