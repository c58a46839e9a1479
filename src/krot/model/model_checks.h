#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "krot/geometry.h"
#include "krot/model.h"

namespace krot::internal {

// A COLMAP model states twice which 2D points see a 3D point: in the tracks and
// in the images. Some scripts write models in which the two differ. COLMAP
// reads these: its bundle adjustment uses the images' statements, its filters
// the tracks'.

struct Contradictions {
  // Track elements whose 2D point names another 3D point or none, does not
  // exist, or is in the same track twice.
  int64_t num_track_elements = 0;
  // 2D points that name a 3D point which does not exist, or whose track does
  // not contain them.
  int64_t num_points2D = 0;
  std::string first;  // describes the first of them in one sentence; "" if none

  // How well one of the two statements fits the model's own positions: the
  // errors of its observations in images with a pose, pixels; infinite where
  // the point does not project.
  struct Fit {
    double median = 0;
    double max = 0;
    // Beside these, observations of images or 2D points that do not exist. The
    // errors are NaN if there are no others.
    int64_t num_missing = 0;
  };
  // Set by SettleContradictions, with `followed`: "tracks", "images", "both" or
  // "neither"; "" if not settled. None if nothing can be measured.
  std::optional<Fit> of_tracks;
  std::optional<Fit> of_images;
  std::string followed;

  bool Any() const { return num_track_elements > 0 || num_points2D > 0; }
};

// Counts the contradictions of a model. Requires consecutive tracks, as
// ReadModel leaves them. O(size of the model), a few ns per 2D point.
Contradictions FindContradictions(const Model& model);

// Whether any track has two elements. If none has, there is nothing to solve
// and no need to choose a statement.
bool HasTrack(const Model& model);

// How Follow decides which 3D point a 2D point sees.
enum class Reading {
  kTracks,  // the point whose track contains it; of several, the one that it
            // names itself, or else the first
  kImages,  // the 3D point that it names
  kBoth,    // the 3D point that it names or, if it names none, the first one
            // whose track contains it
};

// Makes a model that does not contradict itself: every 2D point sees at most
// one 3D point and names it, and the tracks contain exactly the 2D points that
// name their point. In each track the elements that stay keep their order;
// missing ones are appended in the order of the images. A model without
// contradictions does not change. Requires consecutive tracks. O(size of the
// model).
void Follow(Reading reading, Model* model);

// 2D points that name a 3D point which does not exist name none afterwards.
void DropUnknownPoints3D(Model* model);

// Removes track elements of images or 2D points that do not exist, and returns
// their number. Requires consecutive tracks.
int64_t DropUnknownPoints2D(Model* model);

// The angle between two rotations, in [0, 180] degrees.
double AngleDeg(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);

// Suspicious properties of a model's poses that do not prevent reading it.
struct PoseChecks {
  int64_t num_images = 0;  // with a pose

  // Images of which a quaternion, the frame's or the sensor's, is far from unit
  // length. It is normalised, as in COLMAP, which hides numbers in a wrong
  // order.
  int64_t num_far_quaternions = 0;
  // The extreme lengths of these quaternions.
  double shortest = 1;
  double longest = 1;
  std::string first_far;  // name of the first such image
  // Whether all poses seem to be written as TX TY TZ QW QX QY QZ: their last
  // four numbers have unit length.
  bool is_exchanged = false;

  // Images whose pose in the images file differs from the one by rigs and
  // frames. The latter counts, as in COLMAP.
  int64_t num_stale = 0;
  double median_turn_deg = 0;  // between the two poses, of these images
  double largest_turn_deg = 0;
  std::string largest_turn_image;

  bool Any() const { return num_far_quaternions > 0 || num_stale > 0; }
};

// Requires a valid model. O(images).
PoseChecks CheckPoses(const Model& model);

// How listed rotations compare with the model's own rotations of the same
// images.
struct RotationAgreement {
  // Set if they agree much better after a rotation of the world: listed = own *
  // own_world_from_list, nearly.
  std::optional<Eigen::Quaterniond> own_world_from_list;
  // Set if they agree much better in another convention, whatever the world
  // frame: a sentence that says how to correct the list.
  std::string mistake;
};

// Compares camera-from-world rotations, image by image; the listed ones are
// given as the four numbers in the file. Median angles are compared, so half of
// the images may have any rotation. The conventions tried are those of tools
// that write the inverse rotation, QW last, or cameras that look along -z.
// O(images).
RotationAgreement CompareRotations(const std::vector<Eigen::Quaterniond>& own,
                                   const std::vector<QuaternionWxyz>& listed);

}  // namespace krot::internal
