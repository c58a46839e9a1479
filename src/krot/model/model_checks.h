#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "krot/geometry.h"
#include "krot/model.h"

namespace krot::internal {

// A COLMAP model says twice which 2D points see a 3D point: in the tracks and
// in the images. Scripts write models where the two differ. COLMAP reads them:
// its bundle adjustment takes the images' side, its filters take the tracks'.

struct Contradictions {
  // Whose 2D point names another 3D point or none, does not exist, or is in
  // this track already.
  int64_t num_track_elements = 0;
  // That name a 3D point whose track does not name them, or that there is not.
  int64_t num_points2D = 0;
  std::string first;  // the first of them, as one sentence; "" if none

  // How a side fits the model's own positions: errors of its observations whose
  // images have a pose, pixels; infinite where the point does not project.
  struct Fit {
    double median = 0;
    double max = 0;
  };
  // Set by SettleContradictions, as is `followed`: "tracks", "images", "both"
  // or "neither", "" if not settled. No fit: nothing can be measured.
  std::optional<Fit> of_tracks;
  std::optional<Fit> of_images;
  std::string followed;

  bool Any() const { return num_track_elements > 0 || num_points2D > 0; }
};

// Requires consecutive tracks, as ReadModel leaves them.
// O(size of the model), a few ns per 2D point.
Contradictions FindContradictions(const Model& model);

// Whether a track has two elements. Where none has there is nothing to solve,
// and no side to choose.
bool HasTrack(const Model& model);

// Which of the two says what a 2D point sees.
enum class Reading {
  kTracks,  // the track that names it; of several, the one that it names
            // itself, or else the first
  kImages,  // the 3D point that it names
  kBoth,    // the 3D point that it names or, if it names none, the first whose
            // track names it
};

// Makes a model that does not contradict itself: every 2D point sees at most
// one 3D point, and names it; tracks hold what names them and nothing else. Of
// a track, the elements that stay keep their order; those that it lacked are
// appended in the order of the images. A model without contradictions stays as
// it is. Requires consecutive tracks. O(size of the model).
void Follow(Reading reading, Model* model);

// 2D points name none where their 3D point does not exist.
void DropUnknownPoints3D(Model* model);

// Track elements of images or 2D points that do not exist go; returns their
// number. Requires consecutive tracks.
int64_t DropUnknownPoints2D(Model* model);

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
