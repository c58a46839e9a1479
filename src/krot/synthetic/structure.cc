#include "krot/synthetic/scene.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "krot/base/check.h"
#include "krot/camera/camera_model.h"

namespace krot::internal {
namespace {

std::optional<Eigen::Vector2d> OnImagePlane(const Camera& camera,
                                            const Eigen::Vector2d& pixel) {
  const auto undistorted = UndistortPixel(camera, pixel);
  return undistorted ? std::optional(undistorted->u) : std::nullopt;
}

// The largest ||u|| on the image's border, which bounds that of the interior.
// It is needed because a projection may fold rays beyond it back into the
// image.
double MaxRayRadius(const Camera& camera) {
  constexpr int kSamplesPerSide = 16;
  const double width = static_cast<double>(camera.width);
  const double height = static_cast<double>(camera.height);
  double max_radius = 0;
  for (int n = 0; n <= kSamplesPerSide; ++n) {
    const double x = width * n / kSamplesPerSide;
    const double y = height * n / kSamplesPerSide;
    for (const Eigen::Vector2d& pixel :
         {Eigen::Vector2d(x, 0), Eigen::Vector2d(x, height),
          Eigen::Vector2d(0, y), Eigen::Vector2d(width, y)}) {
      const std::optional<Eigen::Vector2d> u = OnImagePlane(camera, pixel);
      CheckArgument(u.has_value(), "focal_length_factor",
                    camera.params[0] / std::max(width, height),
                    "large enough for every pixel to have a ray");
      max_radius = std::max(max_radius, u->norm());
    }
  }
  return std::min(max_radius, 5.67);  // the tangent of 80 degrees
}

}  // namespace

Imaging::Imaging(const Camera& camera, double margin_px,
                 const std::vector<Pose>& cam_from_world)
    : camera_(camera),
      lower_(margin_px, margin_px),
      upper_(static_cast<double>(camera.width) - margin_px,
             static_cast<double>(camera.height) - margin_px),
      has_image_plane_(FindCameraModel(camera.model_id)->has_image_plane),
      max_ray_radius_(has_image_plane_ ? MaxRayRadius(camera) : 0) {
  for (const Pose& pose : cam_from_world) {
    cam_from_world_.push_back(pose.Transform());
  }
}

std::optional<Eigen::Vector2d> Imaging::Project(
    int image, const Eigen::Vector3d& x_world) const {
  const Eigen::Vector3d x_cam = cam_from_world_[image] * x_world;
  const double depth = has_image_plane_ ? x_cam.z() : x_cam.norm();
  if (depth < 0.2) return std::nullopt;
  if (has_image_plane_ && x_cam.hnormalized().norm() > max_ray_radius_) {
    return std::nullopt;
  }
  const Eigen::Vector2d pixel = ProjectPoint(camera_, x_cam).value();
  const bool is_inside = (pixel.array() >= lower_.array()).all() &&
                         (pixel.array() <= upper_.array()).all();
  return is_inside ? std::optional(pixel) : std::nullopt;
}

std::optional<Eigen::Vector3d> Imaging::PointAt(int image,
                                                const Eigen::Vector2d& fraction,
                                                double depth) const {
  const RigidTransform& pose = cam_from_world_[image];
  const Eigen::Vector2d pixel = lower_ + fraction.cwiseProduct(upper_ - lower_);
  std::optional<Eigen::Vector3d> ray;  // at depth 1
  if (has_image_plane_) {
    const std::optional<Eigen::Vector2d> u = OnImagePlane(camera_, pixel);
    if (u) ray = u->homogeneous();
  } else {
    ray = PixelBearing(camera_, pixel);
  }
  if (!ray) return std::nullopt;
  const Eigen::Vector3d x_cam = depth * *ray;
  const Eigen::Vector3d x_world =
      pose.rotation.transpose() * (x_cam - pose.translation);
  if (!Project(image, x_world)) return std::nullopt;
  return x_world;
}

namespace {

class StructureSampler {
 public:
  StructureSampler(const SceneOptions& options, const Trajectory& trajectory,
                   const Imaging& imaging, Random* random)
      : options_(options),
        trajectory_(trajectory),
        imaging_(imaging),
        random_(random),
        offsets_(trajectory.neighbor_offsets) {}

  // Samples a point from the image `anchor` and fills track_; false if no other
  // image sees the point.
  bool SamplePoint(int anchor) {
    track_.clear();
    const double across = random_->Uniform();
    const double down = random_->Uniform();
    const double depth =
        random_->Uniform(trajectory_.min_depth, trajectory_.max_depth);
    const std::optional<Eigen::Vector3d> point =
        imaging_.PointAt(anchor, {across, down}, depth);
    if (!point) return false;
    point_ = *point;
    CollectTrack(anchor, SampleTrackLength());
    return track_.size() >= 2;
  }

  const Eigen::Vector3d& point() const { return point_; }
  const std::vector<Sighting>& track() const { return track_; }

 private:
  // Uniform around the mean; the interval is as wide as [2, number of images]
  // allows.
  size_t SampleTrackLength() {
    const double mean = options_.track_length;
    const double half_width = std::min(mean - 2, imaging_.num_images() - mean);
    const double length = mean + half_width * random_->Uniform(-1, 1);
    const double whole = std::floor(length);
    return static_cast<size_t>(whole) + random_->Chance(length - whole);
  }

  // Collects the anchor, then its frame's other images, then neighbouring
  // frames in random order.
  void CollectTrack(int anchor, size_t length) {
    const int num_sensors = options_.sensors_per_rig;
    const int num_frames = options_.num_frames;
    const int anchor_frame = anchor / num_sensors;
    AddSighting(anchor);
    AddFrame(anchor_frame, anchor, length);

    const size_t max_tries = std::min(offsets_.size(), 4 * length + 16);
    for (size_t n = 0; n < max_tries && track_.size() < length; ++n) {
      int frame = anchor_frame + DrawOffset(n);
      if (trajectory_.is_closed) frame = (frame + num_frames) % num_frames;
      if (frame < 0 || frame >= num_frames) continue;
      AddFrame(frame, anchor, length);
    }
  }

  // The n-th element of a random permutation (Fisher and Yates). The offsets
  // may be in any order before.
  int DrawOffset(size_t n) {
    const size_t rest = offsets_.size() - n;
    const size_t pick = n + random_->UniformInt(static_cast<int64_t>(rest));
    std::swap(offsets_[n], offsets_[pick]);
    return offsets_[n];
  }

  void AddFrame(int frame, int anchor, size_t length) {
    for (int s = 0; s < options_.sensors_per_rig; ++s) {
      if (track_.size() >= length) return;
      const int image = frame * options_.sensors_per_rig + s;
      if (image != anchor) AddSighting(image);
    }
  }

  void AddSighting(int image) {
    const std::optional<Eigen::Vector2d> pixel =
        imaging_.Project(image, point_);
    if (pixel) track_.push_back({image, *pixel});
  }

  const SceneOptions options_;
  const Trajectory& trajectory_;
  const Imaging& imaging_;
  Random* const random_;
  std::vector<int> offsets_;
  Eigen::Vector3d point_;
  std::vector<Sighting> track_;
};

}  // namespace

Structure SampleStructure(const SceneOptions& options,
                          const Trajectory& trajectory, const Imaging& imaging,
                          Random* random) {
  StructureSampler sampler(options, trajectory, imaging, random);
  Structure structure;
  for (int k = 0; k < options.num_points; ++k) {
    const int anchor = k % imaging.num_images();
    int tries = 0;
    while (!sampler.SamplePoint(anchor)) {
      CheckArgument(++tries < 1000, "rig_rotation_deg",
                    options.rig_rotation_deg,
                    "such that every image shares points with another");
    }
    structure.points.push_back(sampler.point());
    structure.sightings.insert(structure.sightings.end(),
                               sampler.track().begin(), sampler.track().end());
    structure.point_begin.push_back(
        static_cast<int64_t>(structure.sightings.size()));
  }
  return structure;
}

}  // namespace krot::internal
