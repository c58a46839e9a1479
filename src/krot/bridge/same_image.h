#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/bridge/bridge.h"
#include "krot/model/image_geometry.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

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

}  // namespace krot
