#include "krot/synthetic/scene_steps.h"

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"

namespace krot::internal {
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
        WriteSighting(structure.sightings[static_cast<size_t>(n)], point.id);
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
    const double x = random_->Uniform(0, options_.image_width);
    const double y = random_->Uniform(0, options_.image_height);
    return {x, y};
  }

  Eigen::Vector2d NoisyPixel(const Eigen::Vector2d& pixel) {
    const double dx = options_.pixel_noise * random_->Gaussian();
    const double dy = options_.pixel_noise * random_->Gaussian();
    return pixel + Eigen::Vector2d(dx, dy);
  }

  void WriteSighting(const Sighting& sighting, Point3DId point_id) {
    if (random_->Chance(options_.outlier_ratio)) {
      outliers_.push_back(static_cast<int64_t>(model_->track_elements.size()));
      WritePoint2D(sighting.image, RandomPixel(), point_id);
    } else {
      WritePoint2D(sighting.image, NoisyPixel(sighting.pixel), point_id);
    }
    if (random_->Chance(options_.duplicate_ratio)) {
      const double dx = random_->Uniform(-kTwinDistance, kTwinDistance);
      const double dy = random_->Uniform(-kTwinDistance, kTwinDistance);
      WritePoint2D(sighting.image,
                   NoisyPixel(sighting.pixel) + Eigen::Vector2d(dx, dy),
                   point_id);
    }
  }

  void WritePoint2D(int image_index, const Eigen::Vector2d& pixel,
                    Point3DId point_id) {
    Image& image = model_->images[static_cast<size_t>(image_index)];
    model_->track_elements.push_back(
        {image.id, static_cast<uint32_t>(image.points2D.size())});
    Point2D point2D;
    point2D.x = std::clamp<double>(pixel.x(), 0, options_.image_width);
    point2D.y = std::clamp<double>(pixel.y(), 0, options_.image_height);
    point2D.point3D_id = point_id;
    image.points2D.push_back(point2D);
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
