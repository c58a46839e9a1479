#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <vector>

#include <Eigen/Core>

#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/synthetic/scene.h"

namespace krot::internal {

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
