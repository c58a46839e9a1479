#pragma once

#include <cstdint>
#include <vector>

#include "krot/database.h"
#include "krot/model.h"

namespace krot::internal {

// Synthetic COLMAP models with ground truth, for tests, benchmarks and demos.

enum class SceneLayout {
  kOrbit,  // frames around a cloud of points, looking in
  kStreet  // frames along a path, looking sideways; a point is seen by
           // neighbouring frames only
};

// Lengths are relative to the viewing distance: the distance from the frames to
// the middle of what they look at is 1.
struct SceneOptions {
  SceneLayout layout = SceneLayout::kOrbit;
  int num_frames = 20;    // in [2, 10^7]
  int num_points = 1000;  // in [1, 10^9]
  // Mean number of images that see a point; in [2, number of images]. This is a
  // target: the mean is lower if fewer images have the points in view.
  double track_length = 6;

  int camera_model_id = 2;  // any model: 0 to 17
  int image_width = 1024;   // pixels; in [64, 65536]
  int image_height = 768;   // pixels; in [64, 65536]
  // Focal length / larger side of the image; in [0.5, 10]. EQUIRECTANGULAR
  // ignores it: its image is the whole panorama.
  double focal_length_factor = 1.0;

  // False makes a legacy model, without rigs and frames; requires
  // sensors_per_rig = 1.
  bool has_rigs = true;
  int sensors_per_rig = 1;  // cameras in the one rig; in [1, 16]
  // Distance of every sensor from the reference sensor; in [0, 0.2].
  double rig_baseline = 0.02;
  // Yaw between neighbouring sensors; in [0, 180].
  double rig_rotation_deg = 10;

  double pixel_noise = 0;  // Gaussian sigma per axis, pixels; in [0, 10]
  // Share of observations that are moved to a uniformly random pixel of their
  // image; in [0, 0.9].
  double outlier_ratio = 0;
  // Share of observations that get a twin: a second 2D point of their image in
  // the same track, up to 2 pixels away per axis; in [0, 1].
  double duplicate_ratio = 0;

  // How far the start of the model to solve is from the truth: Gaussian sigma
  // per axis of frame centres and points, in [0, 1]. A displacement is
  // shortened if it would take a point behind a camera that sees it.
  double start_translation_noise = 0;
  double start_point_noise = 0;
  // Every frame is rotated about a random axis by an angle of this sigma, cut
  // off at 3 sigma; in [0, 3]. Known rotations keep this error.
  double rotation_noise_deg = 0;

  uint64_t random_seed = 0;
};

struct SyntheticScene {
  // The model to solve, with perturbed poses and points.
  Model model;
  // The same observations with the exact poses and points.
  Model ground_truth;
  // The observations that outlier_ratio moved: ascending indices of
  // Model::track_elements, which are the same in both models.
  std::vector<int64_t> outliers;
};

// Throws std::invalid_argument that names the first option out of its range.
void Check(const SceneOptions& options);

// Makes a scene. Every image gets its share of points; every point is in front
// of the images in its track and projects into them; every track has at least
// two images. Both models pass ValidateModel; stored point errors are -1
// (none).
//
// Equal options give equal models: the random numbers are the same on every
// platform. Results differ between platforms only in the last bits of the
// mathematics library.
//
// Throws std::invalid_argument like Check, and if some image shares no points
// with another one (sensors turned too far apart). O(observations); about a
// microsecond each.
SyntheticScene SynthesizeScene(const SceneOptions& options);

// A database from which the model could have been made, if all pairs within its
// tracks were matched: its keypoints are the 2D points, of scale 1, and two
// images have a match for each pair of 2D points that see the same point.
// Requires a valid model. O(sum of squared track lengths).
Database DatabaseOf(const Model& model);

// A camera of the given COLMAP model with its principal point in the middle of
// the image and moderate distortion. fy = 1.01 fx if the model has both. For
// focal_length >= half the larger side the projection is one to one over the
// whole image. A panorama (EQUIRECTANGULAR) fills its image, whatever the focal
// length. Throws std::invalid_argument for an unknown id. Lengths in pixels.
Camera DefaultCamera(int model_id, uint64_t width, uint64_t height,
                     double focal_length);

}  // namespace krot::internal
