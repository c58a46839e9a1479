#include "krot/synthetic/start_noise.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/synthetic/rigid_motion.h"

namespace krot::internal {
namespace {

constexpr double kMaxShareOfDepth = 0.45;

Eigen::Matrix3d RandomRotation(double sigma_deg, Random* random) {
  const double angle_deg =
      sigma_deg * std::clamp(random->Gaussian(), -3.0, 3.0);
  const Eigen::Vector3d axis = random->GaussianVector().normalized();
  return Eigen::AngleAxisd(angle_deg * (kPi / 180), axis).toRotationMatrix();
}

// A Gaussian displacement no longer than max_length.
Eigen::Vector3d RandomDisplacement(double sigma, double max_length,
                                   Random* random) {
  Eigen::Vector3d displacement = sigma * random->GaussianVector();
  const double length = displacement.norm();
  if (length > max_length) displacement *= max_length / length;
  return displacement;
}

// Of a panorama, which sees in all directions, distances.
struct SmallestDepths {
  std::vector<double> of_frame;
  std::vector<double> of_point;
};

SmallestDepths FindSmallestDepths(const SceneGeometry& geometry,
                                  const Structure& structure,
                                  bool has_image_plane) {
  const double infinity = std::numeric_limits<double>::infinity();
  SmallestDepths smallest;
  smallest.of_frame.assign(geometry.rig_from_world.size(), infinity);
  smallest.of_point.assign(geometry.points.size(), infinity);

  std::vector<RigidTransform> cam_from_world;
  for (const Pose& pose : CamFromWorld(geometry)) {
    cam_from_world.push_back(pose.Transform());
  }
  const size_t num_sensors = geometry.sensor_from_rig.size();
  for (size_t k = 0; k < geometry.points.size(); ++k) {
    for (int64_t n = structure.point_begin[k]; n < structure.point_begin[k + 1];
         ++n) {
      const size_t image =
          static_cast<size_t>(structure.sightings[size_t(n)].image);
      const Eigen::Vector3d x_cam = cam_from_world[image] * geometry.points[k];
      const double depth = has_image_plane ? x_cam.z() : x_cam.norm();
      double& of_frame = smallest.of_frame[image / num_sensors];
      of_frame = std::min(of_frame, depth);
      smallest.of_point[k] = std::min(smallest.of_point[k], depth);
    }
  }
  return smallest;
}

}  // namespace

SceneGeometry PerturbStart(const SceneGeometry& truth,
                           const Structure& structure,
                           const SceneOptions& options, Random* random) {
  SceneGeometry start = truth;
  for (Pose& pose : start.rig_from_world) {
    const Eigen::Matrix3d rotation =
        RandomRotation(options.rotation_noise_deg, random) * pose.Rotation();
    pose = PoseFromCenter(rotation, Center(pose.Transform()));
  }
  const SmallestDepths smallest = FindSmallestDepths(
      start, structure,
      FindCameraModel(options.camera_model_id)->has_image_plane);
  for (size_t f = 0; f < start.rig_from_world.size(); ++f) {
    Pose& pose = start.rig_from_world[f];
    pose.translation -=
        pose.Rotation() *
        RandomDisplacement(options.start_translation_noise,
                           kMaxShareOfDepth * smallest.of_frame[f], random);
  }
  for (size_t k = 0; k < start.points.size(); ++k) {
    start.points[k] +=
        RandomDisplacement(options.start_point_noise,
                           kMaxShareOfDepth * smallest.of_point[k], random);
  }
  return start;
}

}  // namespace krot::internal
