#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <vector>

#include <Eigen/Core>

#include "krot/analysis/noise.h"
#include "krot/analysis/track_sample.h"
#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/check.h"
#include "krot/geometry/transform.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot {

using namespace internal;

namespace {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
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
         (intrinsics_factor != 1) + has_central_principal_point +
         !pixel_from_file_axes.isIdentity() +
         static_cast<int>(pixel_maps.size());
}

std::vector<Matrix2d> Conventions::AllPixelAxes() {
  std::vector<Matrix2d> all;
  for (const double x : {1, -1}) {
    for (const double y : {1, -1}) {
      const Matrix2d axes = Vector2d(x, y).asDiagonal();
      all.insert(all.end(), {axes, axes.rowwise().reverse()});
    }
  }
  return all;
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
  const int center = info.num_focal_lengths();
  for (int i = 0; i < center + 2; ++i) converted.params[i] *= factor;
  if (has_central_principal_point) {
    converted.params[center] = static_cast<double>(converted.width) / 2;
    converted.params[center + 1] = static_cast<double>(converted.height) / 2;
  }
  return converted;
}

Vector2d Conventions::ToColmap(const Vector2d& pixel,
                               const Camera& camera) const {
  const Vector2d size(static_cast<double>(camera.width),
                      static_cast<double>(camera.height));
  const Vector2d turned = pixel_from_file_axes * pixel;
  // An axis that is turned round counts from the other side of the photo.
  return (pixel_from_file_axes.rowwise().sum().array() < 0)
      .select(size + turned, turned);
}

Vector3d Conventions::ToColmap(const Vector3d& xyz) const {
  return poses.is_left_handed ? Vector3d(kMirror * xyz) : xyz;
}

namespace {

void Apply(const PixelMap& map, Model* model) {
  for (const Camera& camera : map.cameras) {
    *std::find_if(model->cameras.begin(), model->cameras.end(),
                  [&](const Camera& own) { return own.id == camera.id; }) =
        camera;
  }
  if (!map.cameras.empty()) return;
  const Matrix2d back = map.image_from_camera.leftCols<2>().inverse();
  for (const int32_t n : map.images) {
    for (Point2D& point : model->images[n].points2D) {
      const Vector2d pixel =
          back * (Vector2d(point.x, point.y) - map.image_from_camera.col(2));
      point.x = pixel.x();
      point.y = pixel.y();
    }
  }
}

}  // namespace

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
  for (const PixelMap& map : from.pixel_maps) Apply(map, &converted);
  const std::vector<ImageGeometry> geometries = ImageGeometries(converted);
  const bool turns_pixels = !from.pixel_from_file_axes.isIdentity();
  for (size_t n = 0; turns_pixels && n < converted.images.size(); ++n) {
    for (Point2D& point : converted.images[n].points2D) {
      const Vector2d pixel = from.ToColmap(
          Vector2d(point.x, point.y), converted.cameras[geometries[n].camera]);
      point.x = pixel.x();
      point.y = pixel.y();
    }
  }
  const std::vector<int32_t> image_of = ImagesOfElements(converted);
  for (Point3D& point : converted.points3D) {
    point.xyz = from.ToColmap(point.xyz);
    if (!from.has_wrong_points) continue;
    NearestPoint nearest;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const ImageGeometry& geometry = geometries[image_of[e]];
      if (!geometry.has_pose) continue;
      const Point2D& pixel = converted.images[image_of[e]]
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

namespace {

// The right reading lowers the median error of a wrong model by more than this
// factor; so do some of the many wrong ones, by chance, but not to less than
// this share of the photo's size. Poses from a phone's sensors are as good.
constexpr double kClearly = 4;
constexpr double kFits = 0.01;

// The error below which a reading fits.
double FitPx(const TrackSample& sample) { return kFits * sample.largest_px(); }

// Points may be right where poses are read wrongly.
bool HasWrongPoints(const TrackSample& sample, const Conventions& from) {
  return sample.MedianErrorWithPoints(from) >
         std::max(kFilteredPx, kClearly * from.median_error_px);
}

// Smaller if simpler. Mirrored 2D points are like left-handed axes, which are
// those of game engines, and these write poses from camera to world.
auto Complexity(const Conventions& one) {
  const bool is_rare = one.poses.is_world_from_cam
                           ? one.pixel_from_file_axes.determinant() < 0
                           : one.poses.is_left_handed;
  return std::make_tuple(one.NumDifferences(), is_rare,
                         !one.pixel_from_file_axes.isIdentity(),
                         one.median_error_px);
}

// The simplest within a fifth of the lowest error.
Conventions SimplestOfBest(const std::vector<Conventions>& all) {
  double lowest = kInfinity;
  for (const Conventions& one : all) {
    lowest = std::min(lowest, one.median_error_px);
  }
  const Conventions* simplest = nullptr;
  for (const Conventions& one : all) {
    if (one.median_error_px > 1.2 * lowest) continue;
    if (simplest == nullptr || Complexity(one) < Complexity(*simplest)) {
      simplest = &one;
    }
  }
  return *simplest;
}

// How the images of reference sensors are written. None if they fit in no way,
// and the default if they fit as they are.
std::optional<Conventions> FindPoses(const TrackSample& sample,
                                     const Context& context) {
  const double as_read = sample.MedianErrorWithPoints({});
  if (as_read <= kFilteredPx) return Conventions();
  const double seen = sample.MedianErrorWhereSeen({});
  std::vector<Conventions> all;  // that have been asked
  const auto ask = [&](const Conventions& pixels) {
    std::vector<Conventions> of_poses;
    for (const PoseConventions& poses : PoseConventions::All()) {
      of_poses.emplace_back(pixels).poses = poses;
    }
    sample.Measure(&of_poses, context);
    all.insert(all.end(), of_poses.begin(), of_poses.end());
  };
  const auto find = [&]() -> std::optional<Conventions> {
    Conventions best = SimplestOfBest(all);
    // If points alone are wrong, the poses are as good as COLMAP's.
    const double limit = best.NumDifferences() == 0
                             ? kFilteredPx
                             : std::min(FitPx(sample), seen / kClearly);
    if (best.median_error_px > std::min(limit, as_read / kClearly)) {
      return std::nullopt;
    }
    best.median_error_as_read_px = as_read;
    best.has_wrong_points = HasWrongPoints(sample, best);
    return best;
  };
  ask({});
  std::optional<Conventions> found = find();
  // Mirrored 2D points may fit better than left-handed axes, and others than
  // points that are elsewhere or poses that leave some error. Keypoints of a
  // database are COLMAP's.
  const bool is_all = found && !found->poses.is_left_handed &&
                      !found->has_wrong_points &&
                      found->median_error_px <= kFilteredPx / 4;
  if (!is_all && sample.has_points()) {
    for (const Matrix2d& axes : Conventions::AllPixelAxes()) {
      Conventions pixels;
      pixels.pixel_from_file_axes = axes;
      if (pixels.NumDifferences() > 0) ask(pixels);
    }
    found = find();
  }
  if (found) return found;
  if (seen <= FitPx(sample)) return std::nullopt;  // others do worse
  for (const double factor : {1.0, 0.5, 2.0, 0.25, 4.0, 0.125, 8.0}) {
    for (const bool is_central : {false, true}) {
      Conventions pixels;
      pixels.intrinsics_factor = factor;
      pixels.has_central_principal_point = is_central;
      if (pixels.NumDifferences() == 0) continue;
      // Photos have 2D points all around their principal points.
      if (std::abs(std::log2(sample.MedianPlace(pixels))) > 0.5) continue;
      all.clear();
      ask(pixels);
      if ((found = find())) return found;
    }
  }
  return std::nullopt;
}

// How sensors of rigs are written, all else being `known`, which is returned if
// they fit as they are, or in no way.
Conventions FindSensors(const TrackSample& sample, const Conventions& known,
                        const Context& context) {
  const double seen = sample.MedianErrorWhereSeen(known);
  if (seen <= kFilteredPx) return known;
  std::vector<Conventions> all;
  for (const PoseConventions& sensors : PoseConventions::All()) {
    all.emplace_back(known).sensors = sensors;
  }
  sample.AddWithRigFactors(&all);
  sample.Measure(&all, context);
  Conventions best = SimplestOfBest(all);
  if (best.median_error_px > std::min(FitPx(sample), seen / kClearly)) {
    return known;
  }
  best.median_error_as_read_px =
      std::max(known.median_error_as_read_px, sample.MedianErrorWithPoints({}));
  best.has_wrong_points =
      known.has_wrong_points || HasWrongPoints(sample, best);
  return best;
}

}  // namespace

std::optional<Conventions> FindConventions(const Model& model,
                                           const Database* database,
                                           const Context& context) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const bool is_in_one_place = std::all_of(
      geometries.begin(), geometries.end(), [](const ImageGeometry& one) {
        return !one.has_pose || one.cam_from_world.translation.isZero();
      });
  if (is_in_one_place) return std::nullopt;
  auto [maps, may_be_other] = FindPixelMaps(model, geometries, context);
  if (maps && !may_be_other) return maps;
  auto found =
      FindPoses({model, geometries, kReferencesAlone, database}, context);
  if (!found) return maps;
  if (std::any_of(geometries.begin(), geometries.end(),
                  [](const ImageGeometry& one) { return one.sensor >= 0; })) {
    const TrackSample others(model, geometries, kOthersAtReferences, nullptr);
    found = others.HasEnough()
                ? FindSensors(others, *found, context)
                : FindSensors({model, geometries, kOthers, database}, *found,
                              context);
  }
  if (maps && (found->has_wrong_points || found->NumDifferences() == 0)) {
    return maps;
  }
  const bool differs = found->NumDifferences() > 0 || found->has_wrong_points;
  return differs ? found : std::nullopt;
}

}  // namespace krot
