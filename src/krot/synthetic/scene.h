#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include <Eigen/Core>

#include "krot/database.h"
#include "krot/geometry.h"
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

// ---- The steps of SynthesizeScene ----

// Random numbers that are the same on every platform. The C++ standard fixes
// the bits of the engine, but leaves the distributions to each library, so they
// are implemented here.
class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}

  // In [0, 1), on the grid of 2^-53.
  double Uniform();
  // In [low, high).
  double Uniform(double low, double high);
  // In [0, count); requires 1 <= count < 2^53.
  int64_t UniformInt(int64_t count);
  // Standard normal, by the polar method of Marsaglia and Bray (1964).
  double Gaussian();
  // Independent standard normals.
  Eigen::Vector3d GaussianVector();
  // True with the given probability.
  bool Chance(double probability);

 private:
  std::mt19937_64 engine_;
};

// The geometry of a scene: what a solver estimates, and what it keeps.
struct SceneGeometry {
  std::vector<Pose> rig_from_world;   // per frame
  std::vector<Pose> sensor_from_rig;  // the reference sensor first
  std::vector<Eigen::Vector3d> points;
};

// cam_from_world of every image: image f num_sensors + s is that of sensor s in
// frame f.
std::vector<Pose> CamFromWorld(const SceneGeometry& geometry);

// ---- Poses with quaternions of unit norm ----

Pose UnitPose(const RigidTransform& transform);

// The pose with this rotation and this centre: x -> R (x - center).
Pose PoseFromCenter(const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& center);

// The poses of a scene's frames, and how far they see.
struct Trajectory {
  std::vector<Pose> rig_from_world;
  // Range of the depths at which points are sampled from a frame.
  double min_depth = 0;
  double max_depth = 0;
  // A point that was sampled from frame f may be seen by frame f + offset, for
  // each of these offsets; modulo the number of frames if the trajectory is
  // closed.
  std::vector<int> neighbor_offsets;
  bool is_closed = false;
};

// Makes frames in the order of the path. Requires checked options.
// O(num_frames).
Trajectory MakeTrajectory(const SceneOptions& options, Random* random);

// sensor_from_rig of every sensor. The reference sensor (the identity) comes
// first; the others are on a circle around it, turned alternately to the right
// and to the left.
std::vector<Pose> MakeRigSensors(const SceneOptions& options);

// Says which points the images of a scene see, and at which pixels. All images
// have copies of the same camera.
class Imaging {
 public:
  // A point is in view if its pixel is at least `margin_px` inside the image's
  // border, it is at least 0.2 viewing distances away and, except for
  // panoramas, its ray is less than 80 degrees off the axis. Throws
  // std::invalid_argument if the camera has no ray for a pixel of the border.
  Imaging(const Camera& camera, double margin_px,
          const std::vector<Pose>& cam_from_world);

  int num_images() const { return static_cast<int>(cam_from_world_.size()); }

  // The exact pixel of the point if it is in view.
  std::optional<Eigen::Vector2d> Project(int image,
                                         const Eigen::Vector3d& x_world) const;

  // The point at the given depth (for a panorama: distance) on the ray of a
  // pixel, which is given as a fraction of width and height; none if it is not
  // in view.
  std::optional<Eigen::Vector3d> PointAt(int image,
                                         const Eigen::Vector2d& fraction,
                                         double depth) const;

 private:
  Camera camera_;
  Eigen::Vector2d lower_;  // the smallest and largest pixel in view
  Eigen::Vector2d upper_;
  bool has_image_plane_ = true;
  double max_ray_radius_ = 0;  // ||u|| on z = 1, if there is one
  std::vector<RigidTransform> cam_from_world_;
};

// One point in one image.
struct Sighting {
  int32_t image = 0;
  Eigen::Vector2d pixel;  // exact
};

// The points of a scene and the images that see them.
struct Structure {
  std::vector<Eigen::Vector3d> points;
  // Point k is seen in sightings[point_begin[k], point_begin[k + 1]).
  std::vector<int64_t> point_begin = {0};
  std::vector<Sighting> sightings;
};

// Samples points by back-projection, an equal number from every image, and
// looks for other images that see them among the neighbouring frames only, not
// among all. Image s of frame f is f sensors_per_rig + s. Throws
// std::invalid_argument if some image shares no point with another one.
// O(sightings).
Structure SampleStructure(const SceneOptions& options,
                          const Trajectory& trajectory, const Imaging& imaging,
                          Random* random);

// How far inside the image's border exact projections should be, in pixels, so
// that noise rarely has to be cut off there.
double ObservationMargin(const SceneOptions& options);

// Adds the structure to `model`, whose images must be in the order of
// Sighting::image: 2D points with noise, outliers and twins, 3D points without
// coordinates, and their tracks. Returns the indices of the outliers in
// Model::track_elements, ascending. O(sightings).
std::vector<int64_t> WriteObservations(const Structure& structure,
                                       const SceneOptions& options,
                                       Random* random, Model* model);

// A copy of `truth` with rotations, frame centres and points perturbed as
// `options` say. All depths stay positive: let d be the smallest depth of the
// points that a frame sees (after its rotation), or of a point in the frames
// that see it. Each frame and point moves by at most 0.45 d, which leaves a
// tenth of every depth. O(sightings).
SceneGeometry PerturbStart(const SceneGeometry& truth,
                           const Structure& structure,
                           const SceneOptions& options, Random* random);

}  // namespace krot::internal
