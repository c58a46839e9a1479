#include <cmath>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/camera/camera_model.h"
#include "krot/check.h"
#include "krot/geometry/transform.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot {

using namespace internal;

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

const Matrix3d kMirror = Vector3d(1, -1, 1).asDiagonal();

RigidTransform Converted(const Pose& pose, const PoseConventions& from) {
  QuaternionWxyz wxyz = pose.quaternion_wxyz;
  if (from.has_w_last) wxyz = {wxyz[3], wxyz[0], wxyz[1], wxyz[2]};
  Matrix3d rotation = RotationOf(wxyz);
  if (from.is_world_from_cam) rotation.transposeInPlace();
  Vector3d translation = pose.translation;
  if (from.has_centers) translation = -rotation * translation;
  if (from.is_left_handed) {
    rotation = kMirror * rotation * kMirror;
    translation = kMirror * translation;
  }
  return {from.cam_from_file_axes * rotation,
          from.cam_from_file_axes * translation};
}

// The rotations that take axes to axes.
std::vector<Matrix3d> AxisRotations() {
  std::vector<Matrix3d> rotations;
  for (const int i : {0, 1, 2}) {
    for (const int j : {(i + 1) % 3, (i + 2) % 3}) {
      for (const int signs : {0, 1, 2, 3}) {
        const Vector3d x = ((signs & 1) != 0 ? -1 : 1) * Vector3d::Unit(i);
        const Vector3d y = ((signs & 2) != 0 ? -1 : 1) * Vector3d::Unit(j);
        rotations.emplace_back() << x, y, x.cross(y);
      }
    }
  }
  return rotations;
}

}  // namespace

std::vector<PoseConventions> PoseConventions::All() {
  std::vector<PoseConventions> all;
  for (int bits = 0; bits < 16; ++bits) {
    for (const Matrix3d& cam_from_file_axes : AxisRotations()) {
      all.push_back({(bits & 1) != 0, (bits & 2) != 0, (bits & 4) != 0,
                     (bits & 8) != 0, cam_from_file_axes});
    }
  }
  return all;
}

int PoseConventions::NumDifferences() const {
  return has_w_last + (is_world_from_cam || has_centers) +
         (is_left_handed || !cam_from_file_axes.isIdentity());
}

int Conventions::NumDifferences() const {
  return poses.NumDifferences() + sensors.NumDifferences() + (rig_factor != 1) +
         (intrinsics_factor != 1) + has_central_principal_point;
}

Pose Conventions::ToColmap(const Pose& pose) const {
  return poses.NumDifferences() == 0 ? pose : ToPose(Converted(pose, poses));
}

Pose Conventions::SensorToColmap(const Pose& sensor_from_rig) const {
  if (sensors.NumDifferences() == 0 && rig_factor == 1) return sensor_from_rig;
  RigidTransform converted = Converted(sensor_from_rig, sensors);
  converted.rotation *= sensors.cam_from_file_axes.transpose();
  converted.translation *= rig_factor;
  return ToPose(converted);
}

Camera Conventions::ToColmap(const Camera& camera) const {
  Camera converted = camera;
  const CameraModelInfo& info = *FindCameraModel(camera.model_id);
  if (!info.has_image_plane) return camera;
  const double factor = intrinsics_factor;
  converted.width = std::llround(factor * static_cast<double>(camera.width));
  converted.height = std::llround(factor * static_cast<double>(camera.height));
  const size_t center = info.param_names.substr(0, 2) == "fx" ? 2 : 1;
  for (size_t i = 0; i < center + 2; ++i) converted.params[i] *= factor;
  if (has_central_principal_point) {
    converted.params[center] = static_cast<double>(converted.width) / 2;
    converted.params[center + 1] = static_cast<double>(converted.height) / 2;
  }
  return converted;
}

Vector3d Conventions::ToColmap(const Vector3d& xyz) const {
  return poses.is_left_handed ? Vector3d(kMirror * xyz) : xyz;
}

Model ConvertModel(const Model& model, const Conventions& from,
                   const Context& context) {
  Model converted = model;
  for (Camera& camera : converted.cameras) camera = from.ToColmap(camera);
  for (Rig& rig : converted.rigs) {
    for (RigSensor& sensor : rig.sensors) {
      std::optional<Pose>& place = sensor.sensor_from_rig;
      if (place) place = from.SensorToColmap(*place);
    }
  }
  for (Frame& frame : converted.frames) {
    frame.rig_from_world = from.ToColmap(frame.rig_from_world);
  }
  FollowFrames(&converted);
  const std::vector<ImageGeometry> geometries = ImageGeometries(converted);
  const std::vector<int32_t> image_of = ImagesOfElements(converted);
  for (Point3D& point : converted.points3D) {
    point.xyz = from.ToColmap(point.xyz);
    if (!from.has_wrong_points) continue;
    NearestPoint nearest;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const ImageGeometry& geometry = geometries[image_of[e]];
      if (!geometry.has_pose) continue;
      const Point2D& pixel = model.images[image_of[e]]
                                 .points2D[model.track_elements[e].point2D_idx];
      const auto bearing =
          PixelBearing(converted.cameras[geometry.camera], {pixel.x, pixel.y});
      if (!bearing) continue;
      const RigidTransform& cam_from_world = geometry.cam_from_world;
      nearest.Add(Center(cam_from_world),
                  cam_from_world.rotation.transpose() * *bearing, 1);
    }
    point.xyz = nearest.Solve().value_or(point.xyz);
  }
  UpdatePointErrors(PixelErrors(converted, context.num_threads), &converted);
  return converted;
}

}  // namespace krot
