#include "krot/synthetic/scene_steps.h"

#include <algorithm>
#include <cmath>

#include "krot/base/numbers.h"

namespace krot::internal {

double Random::Uniform() {
  return static_cast<double>(engine_() >> 11) * 0x1p-53;
}

double Random::Uniform(double low, double high) {
  return low + (high - low) * Uniform();
}

int64_t Random::UniformInt(int64_t count) {
  return static_cast<int64_t>(Uniform() * static_cast<double>(count));
}

double Random::Gaussian() {
  while (true) {
    const double x = Uniform(-1, 1);
    const double y = Uniform(-1, 1);
    const double s = x * x + y * y;
    if (s > 0 && s < 1) return x * std::sqrt(-2 * std::log(s) / s);
  }
}

Eigen::Vector3d Random::GaussianVector() {
  const double x = Gaussian();
  const double y = Gaussian();
  const double z = Gaussian();
  return {x, y, z};
}

bool Random::Chance(double probability) { return Uniform() < probability; }

std::vector<Pose> CamFromWorld(const SceneGeometry& geometry) {
  std::vector<Pose> cam_from_world;
  cam_from_world.reserve(geometry.rig_from_world.size() *
                         geometry.sensor_from_rig.size());
  for (const Pose& rig_from_world : geometry.rig_from_world) {
    for (const Pose& sensor_from_rig : geometry.sensor_from_rig) {
      cam_from_world.push_back(
          UnitPose(sensor_from_rig.Transform() * rig_from_world.Transform()));
    }
  }
  return cam_from_world;
}

Pose UnitPose(const RigidTransform& transform) {
  return {ToWxyz(Eigen::Quaterniond(transform.rotation).normalized()),
          transform.translation};
}

Pose PoseFromCenter(const Eigen::Matrix3d& rotation,
                    const Eigen::Vector3d& center) {
  return UnitPose({rotation, -(rotation * center)});
}

namespace {

// The rotation of a camera that looks along `forward`; the world's y axis
// points down.
Eigen::Matrix3d LookAlong(const Eigen::Vector3d& forward) {
  const Eigen::Vector3d z = forward.normalized();
  const Eigen::Vector3d x = Eigen::Vector3d::UnitY().cross(z).normalized();
  Eigen::Matrix3d cam_from_world;
  cam_from_world << x.transpose(), z.cross(x).transpose(), z.transpose();
  return cam_from_world;
}

// The offsets from -reach to reach without 0, or to all other frames once if
// these overlap around a closed trajectory.
std::vector<int> NeighborOffsets(int reach, int num_frames, bool is_closed) {
  reach = std::min(reach, num_frames - 1);
  int first = -reach;
  int last = reach;
  if (is_closed && 2 * reach >= num_frames) {
    first = 1;
    last = num_frames - 1;
  }
  std::vector<int> offsets;
  for (int offset = first; offset <= last; ++offset) {
    if (offset != 0) offsets.push_back(offset);
  }
  return offsets;
}

// How many neighbours on each side are candidates for seeing a point; about
// half of them do.
int CandidateReach(const SceneOptions& options) {
  return static_cast<int>(std::ceil(2 * options.track_length));
}

// A ring around the origin that rises and falls three times.
Trajectory MakeOrbit(const SceneOptions& options, Random* random) {
  Trajectory trajectory;
  for (int f = 0; f < options.num_frames; ++f) {
    const double angle = 2 * kPi * f / options.num_frames;
    const Eigen::Vector3d center(
        std::cos(angle),
        0.3 * std::sin(3 * angle) + random->Uniform(-0.05, 0.05),
        std::sin(angle));
    const Eigen::Vector3d target = 0.03 * random->GaussianVector();
    trajectory.rig_from_world.push_back(
        PoseFromCenter(LookAlong(target - center), center));
  }
  trajectory.min_depth = 0.75;
  trajectory.max_depth = 1.25;
  trajectory.is_closed = true;
  trajectory.neighbor_offsets =
      NeighborOffsets(std::max(CandidateReach(options), options.num_frames / 8),
                      options.num_frames, trajectory.is_closed);
  return trajectory;
}

// A gently winding path, with frames that look to its side. They are so close
// together that about 2 track_length of them see a point.
Trajectory MakeStreet(const SceneOptions& options, Random* random) {
  const double focal_length =
      options.focal_length_factor *
      std::max(options.image_width, options.image_height);
  const double view_width = options.image_width / focal_length;
  const double spacing = view_width / (2 * options.track_length);

  Trajectory trajectory;
  Eigen::Vector3d on_path = Eigen::Vector3d::Zero();
  for (int f = 0; f < options.num_frames; ++f) {
    const double heading = 0.3 * std::sin(2 * kPi * f * spacing / 20);
    const Eigen::Vector3d ahead(std::cos(heading), 0, std::sin(heading));
    const Eigen::Vector3d aside(-std::sin(heading), 0, std::cos(heading));
    const Eigen::Vector3d center = on_path + 0.02 * random->GaussianVector();
    const Eigen::Vector3d forward = aside + 0.03 * random->GaussianVector();
    trajectory.rig_from_world.push_back(
        PoseFromCenter(LookAlong(forward), center));
    on_path += spacing * ahead;
  }
  trajectory.min_depth = 0.6;
  trajectory.max_depth = 1.4;
  trajectory.neighbor_offsets = NeighborOffsets(
      CandidateReach(options), options.num_frames, trajectory.is_closed);
  return trajectory;
}

}  // namespace

Trajectory MakeTrajectory(const SceneOptions& options, Random* random) {
  return options.layout == SceneLayout::kOrbit ? MakeOrbit(options, random)
                                               : MakeStreet(options, random);
}

std::vector<Pose> MakeRigSensors(const SceneOptions& options) {
  std::vector<Pose> sensor_from_rig = {Pose()};
  for (int s = 1; s < options.sensors_per_rig; ++s) {
    const int steps = (s + 1) / 2;
    const int side = s % 2 == 1 ? 1 : -1;
    const double yaw = side * steps * options.rig_rotation_deg * kPi / 180;
    const double angle = 2 * kPi * (s - 1) / (options.sensors_per_rig - 1);
    const Eigen::Vector3d center =
        options.rig_baseline *
        Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
    const Eigen::Matrix3d rotation =
        Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitY()).toRotationMatrix();
    sensor_from_rig.push_back(PoseFromCenter(rotation, center));
  }
  return sensor_from_rig;
}

}  // namespace krot::internal
