#include "krot/synthetic/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"

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
  return {Gaussian(), Gaussian(), Gaussian()};  // from left to right
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

namespace {

constexpr double kTwinDistance = 2;  // pixels, per axis

class ObservationWriter {
 public:
  ObservationWriter(const SceneOptions& options, Random* random, Model* model)
      : options_(options), random_(random), model_(model) {}

  std::vector<int64_t> Write(const Structure& structure) {
    for (size_t k = 0; k < structure.points.size(); ++k) {
      Point3D point;
      point.id = k + 1;
      point.color = RandomColor();
      point.track_begin = model_->track_elements.size();
      for (int64_t n = structure.point_begin[k];
           n < structure.point_begin[k + 1]; ++n) {
        WriteSighting(structure.sightings[n], point.id);
      }
      point.track_end = model_->track_elements.size();
      model_->points3D.push_back(point);
    }
    return outliers_;
  }

 private:
  std::array<uint8_t, 3> RandomColor() {
    std::array<uint8_t, 3> color;
    for (uint8_t& channel : color) {
      channel = static_cast<uint8_t>(random_->UniformInt(256));
    }
    return color;
  }

  Eigen::Vector2d RandomPixel() {
    return {random_->Uniform(0, options_.image_width),
            random_->Uniform(0, options_.image_height)};
  }

  Eigen::Vector2d NoisyPixel(const Eigen::Vector2d& pixel) {
    return pixel + Eigen::Vector2d{options_.pixel_noise * random_->Gaussian(),
                                   options_.pixel_noise * random_->Gaussian()};
  }

  void WriteSighting(const Sighting& sighting, Point3DId point_id) {
    if (random_->Chance(options_.outlier_ratio)) {
      outliers_.push_back(static_cast<int64_t>(model_->track_elements.size()));
      WritePoint2D(sighting.image, RandomPixel(), point_id);
    } else {
      WritePoint2D(sighting.image, NoisyPixel(sighting.pixel), point_id);
    }
    if (random_->Chance(options_.duplicate_ratio)) {
      const Eigen::Vector2d offset{
          random_->Uniform(-kTwinDistance, kTwinDistance),
          random_->Uniform(-kTwinDistance, kTwinDistance)};
      WritePoint2D(sighting.image, NoisyPixel(sighting.pixel) + offset,
                   point_id);
    }
  }

  void WritePoint2D(int image_index, const Eigen::Vector2d& pixel,
                    Point3DId point_id) {
    Image& image = model_->images[image_index];
    model_->track_elements.push_back(
        {image.id, static_cast<uint32_t>(image.points2D.size())});
    image.points2D.push_back(
        {std::clamp<double>(pixel.x(), 0, options_.image_width),
         std::clamp<double>(pixel.y(), 0, options_.image_height), point_id});
  }

  const SceneOptions options_;
  Random* const random_;
  Model* const model_;
  std::vector<int64_t> outliers_;
};

}  // namespace

double ObservationMargin(const SceneOptions& options) {
  const double wanted = 3 * options.pixel_noise +
                        (options.duplicate_ratio > 0 ? kTwinDistance : 0);
  const double smaller_side =
      std::min(options.image_width, options.image_height);
  return std::min(wanted, smaller_side / 8);
}

std::vector<int64_t> WriteObservations(const Structure& structure,
                                       const SceneOptions& options,
                                       Random* random, Model* model) {
  return ObservationWriter(options, random, model).Write(structure);
}

namespace {

constexpr double kMaxShareOfDepth = 0.45;

Eigen::Matrix3d RandomRotation(double sigma_deg, Random* random) {
  const double angle_deg =
      sigma_deg * std::clamp(random->Gaussian(), -3.0, 3.0);
  const Eigen::Vector3d axis = random->GaussianVector().normalized();
  return Eigen::AngleAxisd(angle_deg * (kPi / 180), axis).toRotationMatrix();
}

// A Gaussian displacement, shortened to max_length if it is longer.
Eigen::Vector3d RandomDisplacement(double sigma, double max_length,
                                   Random* random) {
  Eigen::Vector3d displacement = sigma * random->GaussianVector();
  const double length = displacement.norm();
  if (length > max_length) displacement *= max_length / length;
  return displacement;
}

// For panoramas, which see in all directions, these are distances.
struct SmallestDepths {
  std::vector<double> of_frame;
  std::vector<double> of_point;
};

SmallestDepths FindSmallestDepths(const SceneGeometry& geometry,
                                  const Structure& structure,
                                  bool has_image_plane) {
  SmallestDepths smallest;
  smallest.of_frame.assign(geometry.rig_from_world.size(), kInfinity);
  smallest.of_point.assign(geometry.points.size(), kInfinity);
  std::vector<RigidTransform> cam_from_world;
  for (const Pose& pose : CamFromWorld(geometry)) {
    cam_from_world.push_back(pose.Transform());
  }
  const size_t num_sensors = geometry.sensor_from_rig.size();
  for (size_t k = 0; k < geometry.points.size(); ++k) {
    for (int64_t n = structure.point_begin[k]; n < structure.point_begin[k + 1];
         ++n) {
      const int32_t image = structure.sightings[n].image;
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
