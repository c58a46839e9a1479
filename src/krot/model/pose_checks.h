#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "krot/geometry.h"
#include "krot/model.h"

namespace krot::internal {

// The angle between two rotations, in [0, 180] degrees.
double AngleDeg(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

// What is odd about the poses of a model that can be read all the same.
struct PoseChecks {
  int64_t num_images = 0;  // with a pose

  // Whose frame's, or sensor's, quaternion is far from unit length. It is
  // normalised, as COLMAP does, which hides numbers in a wrong order.
  int64_t num_far_quaternions = 0;
  double shortest = 1;
  double longest = 1;
  std::string first_far;  // image
  // All poses read TX TY TZ QW QX QY QZ, by the length of the last four.
  bool is_exchanged = false;

  // Whose pose in the images file is not the one that rigs and frames give,
  // which counts, as in COLMAP.
  int64_t num_stale = 0;
  double median_turn_deg = 0;  // between the two, of the stale ones
  double largest_turn_deg = 0;
  std::string largest_turn_image;

  bool Any() const { return num_far_quaternions > 0 || num_stale > 0; }
};

// Requires a valid model. O(images).
PoseChecks CheckPoses(const Model& model);

// How rotations from elsewhere stand to a model's own of the same images.
struct RotationAgreement {
  // Where they agree much better after a rotation of the world:
  // listed = own * own_world_from_list, nearly.
  std::optional<Eigen::Quaterniond> own_world_from_list;
  // Where they agree much better in another convention, whatever the world
  // frame: a sentence with the cure.
  std::string mistake;
};

// Camera-from-world rotations, image by image; the listed ones as their four
// numbers stand in the file. What is compared are median angles: half of the
// images may be anywhere. The conventions are those of tools that write the
// inverse rotation, QW last, or cameras that look along -z. O(images).
RotationAgreement CompareRotations(const std::vector<Eigen::Quaterniond>& own,
                                   const std::vector<QuaternionWxyz>& listed);

}  // namespace krot::internal
