#include "krot/model/rigs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <iomanip>
#include <sstream>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/model.h"
#include "krot/model/model_checks.h"

namespace krot::internal {
namespace {

// Composes the pose of `image` from its frame's pose and its sensor's pose in
// the rig.
void Place(const Pose& rig_from_world, const Pose& cam_from_rig,
           ImageGeometry* image) {
  image->rig_from_world = rig_from_world.Transform();
  image->cam_from_rig = cam_from_rig.Transform();
  image->cam_from_world = image->cam_from_rig * image->rig_from_world;
  image->has_pose = image->cam_from_world.translation.allFinite() &&
                    image->rig_from_world.rotation.allFinite();
}

}  // namespace

std::vector<ImageGeometry> ImageGeometries(const Model& model) {
  const IdIndex<CameraId> camera_index(model.cameras);
  const IdIndex<RigId> rig_index(model.rigs);
  const IdIndex<ImageId> image_index(model.images);
  std::vector<ImageGeometry> images(model.images.size());
  for (size_t n = 0; n < images.size(); ++n) {
    images[n].camera = camera_index.Find(model.images[n].camera_id).value();
  }
  for (size_t f = 0; f < model.frames.size(); ++f) {
    const Frame& frame = model.frames[f];
    const int32_t rig = rig_index.Find(frame.rig_id).value();
    for (const FrameData& data : frame.data) {
      if (data.sensor_id.type != kSensorTypeCamera) continue;
      const std::optional<SensorPlace> place =
          FindSensor(model.rigs[rig], data.sensor_id);
      if (!place || !place->sensor_from_rig) continue;
      const auto found = image_index.Find(static_cast<ImageId>(data.data_id));
      if (!found) continue;
      ImageGeometry& image = images[*found];
      image.frame = static_cast<int32_t>(f);
      image.rig = rig;
      image.sensor = place->index;
      Place(frame.rig_from_world, *place->sensor_from_rig, &image);
    }
  }
  return images;
}

std::optional<PixelRay> RayOf(const Camera& camera,
                              const Eigen::Vector2d& pixel) {
  const auto undistorted = UndistortPixel(camera, pixel);
  if (!undistorted) return std::nullopt;
  PixelRay ray;
  ray.ray = undistorted->u.homogeneous();
  ray.by_pixel << undistorted->J.inverse(), 0, 0;
  return ray;
}

std::optional<SensorPlace> FindSensor(const Rig& rig,
                                      const SensorId& sensor_id) {
  if (rig.ref_sensor_id && *rig.ref_sensor_id == sensor_id) {
    return SensorPlace{-1, Pose()};
  }
  for (size_t i = 0; i < rig.sensors.size(); ++i) {
    if (!(rig.sensors[i].sensor_id == sensor_id)) continue;
    return SensorPlace{static_cast<int32_t>(i), rig.sensors[i].sensor_from_rig};
  }
  return std::nullopt;
}

std::unordered_map<ImageId, int32_t> ImageIndices(const Model& model) {
  std::unordered_map<ImageId, int32_t> indices;
  indices.reserve(model.images.size());
  for (size_t n = 0; n < model.images.size(); ++n) {
    indices.emplace(model.images[n].id, static_cast<int32_t>(n));
  }
  return indices;
}

std::unordered_map<std::string_view, int32_t> ImagesByName(const Model& model) {
  std::unordered_map<std::string_view, int32_t> indices;
  for (size_t n = 0; n < model.images.size(); ++n) {
    indices.emplace(model.images[n].name, static_cast<int32_t>(n));
  }
  return indices;
}

std::vector<int32_t> ImagesOfElements(const Model& model) {
  const auto indices = ImageIndices(model);
  std::vector<int32_t> images;
  images.reserve(model.track_elements.size());
  for (const TrackElement& element : model.track_elements) {
    images.push_back(indices.at(element.image_id));
  }
  return images;
}

namespace {

// Of the types from -1 on.
const std::array<std::string_view, 3> kSensorTypes = {"INVALID", "CAMERA",
                                                      "IMU"};

}  // namespace

std::optional<std::string_view> SensorTypeName(int32_t type) {
  if (type < -1 || type > 1) return std::nullopt;
  return kSensorTypes[static_cast<size_t>(type + 1)];
}

std::optional<int32_t> SensorTypeFromName(std::string_view name) {
  const auto found = std::find(kSensorTypes.begin(), kSensorTypes.end(), name);
  if (found == kSensorTypes.end()) return std::nullopt;
  return static_cast<int32_t>(found - kSensorTypes.begin()) - 1;
}

void UseTrivialRigs(Model* model) {
  model->rigs.clear();
  for (const Camera& camera : model->cameras) {
    const SensorId sensor_id{kSensorTypeCamera, camera.id};
    model->rigs.push_back({camera.id, sensor_id, {}});
  }
  model->frames.clear();
  for (const Image& image : model->images) {
    const SensorId sensor_id{kSensorTypeCamera, image.camera_id};
    model->frames.push_back({image.id,
                             image.camera_id,
                             image.cam_from_world,
                             {{sensor_id, image.id}}});
  }
}

void FollowFrames(Model* model) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(*model);
  for (size_t n = 0; n < model->images.size(); ++n) {
    if (!geometries[n].rig_from_world.rotation.allFinite()) continue;
    model->images[n].cam_from_world = ToPose(geometries[n].cam_from_world);
  }
}

namespace {

// Two poses are the same up to this: radians, or relative to a length. Rounding
// to six digits causes much smaller differences.
constexpr double kSamePose = 1e-3;

using Rotations = std::vector<Eigen::Quaterniond>;

// How other tools write a rotation as four numbers a b c d. `numbers` says
// which of them are QW QX QY QZ, camera from world: 1 is a, -2 is -b.
struct Convention {
  std::array<int, 4> numbers;
  const char* meaning;
};
constexpr std::array<Convention, 8> kConventions = {{
    {{1, 2, 3, 4}, "as they stand"},
    {{1, -2, -3, -4}, "world from camera, the inverse"},
    {{4, 1, 2, 3}, "QX QY QZ QW"},
    {{4, -1, -2, -3}, "QX QY QZ QW of world from camera, the inverse"},
    {{-2, 1, -4, 3}, "of a camera that looks along -z, with y upwards"},
    {{2, 1, 4, -3},
     "world from camera, the inverse, of a camera that looks along -z"},
    {{-1, 4, -3, 2}, "QX QY QZ QW of a camera that looks along -z"},
    {{1, 4, 3, -2},
     "QX QY QZ QW of world from camera, the inverse, of a camera that looks "
     "along -z"},
}};

// One explanation is much better than another if its median angle is less than
// a fifth of the other's, and the other's is above a degree.
bool IsMuchBetter(double median_deg, double than_deg) {
  return than_deg > 1 && 5 * median_deg < than_deg;
}

Rotations ReadAs(const Convention& convention,
                 const std::vector<QuaternionWxyz>& listed) {
  Rotations rotations;
  for (const QuaternionWxyz& numbers : listed) {
    QuaternionWxyz wxyz;
    for (size_t k = 0; k < 4; ++k) {
      const int number = convention.numbers[k];
      const double value = numbers[static_cast<size_t>(std::abs(number) - 1)];
      wxyz[k] = number < 0 ? -value : value;
    }
    rotations.push_back(NormalizedQuaternion(wxyz));
  }
  return rotations;
}

// For example "-b a -d c".
std::string WrittenAs(const Convention& convention) {
  std::string text;
  for (const int number : convention.numbers) {
    text += text.empty() ? "" : " ";
    text += number < 0 ? "-" : "";
    text += static_cast<char>('a' + std::abs(number) - 1);
  }
  return text;
}

// The angles by which listed = own * own_world_from_list is missed.
std::vector<double> AnglesDeg(const Rotations& own, const Rotations& listed,
                              const Eigen::Quaterniond& own_world_from_list) {
  std::vector<double> angles(own.size());
  for (size_t n = 0; n < own.size(); ++n) {
    angles[n] = AngleDeg(own[n] * own_world_from_list, listed[n]);
  }
  return angles;
}

// The rotation of the world with the smallest median angle. Candidates are the
// rotations that single images suggest (at most 32 images); the best one is
// refined by the mean over the half of the images that fit it best. O(images).
struct WorldTurn {
  Eigen::Quaterniond own_world_from_list = Eigen::Quaterniond::Identity();
  double median_deg = kInfinity;
};
WorldTurn FindWorldTurn(const Rotations& own, const Rotations& listed) {
  WorldTurn best;
  const size_t step = (own.size() + 31) / 32;
  for (size_t n = 0; n < own.size(); n += step) {
    const Eigen::Quaterniond turn = own[n].conjugate() * listed[n];
    const double median_deg = Median(AnglesDeg(own, listed, turn));
    if (median_deg < best.median_deg) best = {turn, median_deg};
  }
  const std::vector<double> angles =
      AnglesDeg(own, listed, best.own_world_from_list);
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (size_t n = 0; n < own.size(); ++n) {
    if (angles[n] > best.median_deg) continue;
    sum += (own[n].conjugate() * listed[n]).toRotationMatrix();
  }
  const std::optional<Eigen::Matrix3d> mean = NearestRotation(sum);
  if (!mean) return best;
  const Eigen::Quaterniond turn(*mean);
  const double median_deg = Median(AnglesDeg(own, listed, turn));
  return median_deg < best.median_deg ? WorldTurn{turn, median_deg} : best;
}

std::string Degrees(double angle_deg) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(2) << angle_deg;
  return text.str();
}

double Length(const QuaternionWxyz& q) {
  return std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3]));
}

// An image without a pose may have a quaternion of zeros, which does not count.
bool IsFar(const Pose& pose) {
  const double length = Length(pose.quaternion_wxyz);
  return length > 0 && std::abs(length - 1) > 0.01;
}

void CheckQuaternions(const Model& model,
                      const std::vector<ImageGeometry>& geometries,
                      PoseChecks* checks) {
  bool is_exchanged = true;
  for (size_t n = 0; n < geometries.size(); ++n) {
    const ImageGeometry& geometry = geometries[n];
    if (!geometry.has_pose) continue;
    ++checks->num_images;
    const Pose& frame = model.frames[geometry.frame].rig_from_world;
    const Eigen::Vector3d& t = frame.translation;
    is_exchanged &=
        std::abs(Length({frame.quaternion_wxyz[3], t[0], t[1], t[2]}) - 1) <=
        kSamePose;
    const Pose* odd = IsFar(frame) ? &frame : nullptr;
    if (odd == nullptr && geometry.sensor >= 0) {
      const auto& sensor = model.rigs[geometry.rig].sensors[geometry.sensor];
      if (IsFar(*sensor.sensor_from_rig)) odd = &*sensor.sensor_from_rig;
    }
    if (odd == nullptr) continue;
    const double length = Length(odd->quaternion_wxyz);
    if (checks->num_far_quaternions++ == 0) {
      checks->shortest = checks->longest = length;
      checks->first_far = model.images[n].name;
    }
    checks->shortest = std::min(checks->shortest, length);
    checks->longest = std::max(checks->longest, length);
  }
  checks->is_exchanged = is_exchanged && checks->num_far_quaternions > 0;
}

void FindStaleImages(const Model& model,
                     const std::vector<ImageGeometry>& geometries,
                     PoseChecks* checks) {
  if (!model.stores_rigs) return;  // frames are made from images then
  double size = 0;
  for (const ImageGeometry& geometry : geometries) {
    if (!geometry.has_pose) continue;
    size = std::max(size, geometry.cam_from_world.translation.norm());
  }
  std::vector<double> turns_deg;
  for (size_t n = 0; n < geometries.size(); ++n) {
    const Pose& stored = model.images[n].cam_from_world;
    const bool is_stored =
        stored.translation.allFinite() && Length(stored.quaternion_wxyz) > 0;
    if (!geometries[n].has_pose || !is_stored) continue;
    const RigidTransform& pose = geometries[n].cam_from_world;
    const double turn_deg = AngleDeg(Eigen::Quaterniond(stored.Rotation()),
                                     Eigen::Quaterniond(pose.rotation));
    const double move = (stored.translation - pose.translation).norm();
    const bool is_same =
        turn_deg <= kSamePose * 180 / kPi && move <= kSamePose * size;
    if (is_same) continue;
    turns_deg.push_back(turn_deg);
    if (turn_deg >= checks->largest_turn_deg) {
      checks->largest_turn_deg = turn_deg;
      checks->largest_turn_image = model.images[n].name;
    }
  }
  checks->num_stale = static_cast<int64_t>(turns_deg.size());
  if (!turns_deg.empty()) checks->median_turn_deg = Median(turns_deg);
}

}  // namespace

double AngleDeg(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return a.angularDistance(b) * 180 / kPi;
}

PoseChecks CheckPoses(const Model& model) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  PoseChecks checks;
  CheckQuaternions(model, geometries, &checks);
  FindStaleImages(model, geometries, &checks);
  return checks;
}

RotationAgreement CompareRotations(const Rotations& own,
                                   const std::vector<QuaternionWxyz>& listed) {
  RotationAgreement agreement;
  if (own.empty()) return agreement;
  const Rotations as_written = ReadAs(kConventions.front(), listed);
  const WorldTurn turn = FindWorldTurn(own, as_written);
  WorldTurn best = turn;
  const Convention* best_convention = nullptr;
  for (const Convention& convention : kConventions) {
    const WorldTurn other = FindWorldTurn(own, ReadAs(convention, listed));
    if (!(other.median_deg < best.median_deg)) continue;
    best = other;
    best_convention = &convention;
  }
  if (IsMuchBetter(best.median_deg, turn.median_deg)) {
    agreement.mistake =
        "found rotations that are " + Degrees(turn.median_deg) +
        " degrees off the model's own (median, in any world frame), and only " +
        Degrees(best.median_deg) +
        " once the numbers a b c d of each line are written " +
        WrittenAs(*best_convention) + ": they are " + best_convention->meaning +
        "; expected QW QX QY QZ, camera from world";
    return agreement;
  }
  const double median_deg =
      Median(AnglesDeg(own, as_written, Eigen::Quaterniond::Identity()));
  if (IsMuchBetter(turn.median_deg, median_deg)) {
    agreement.own_world_from_list = turn.own_world_from_list;
  }
  return agreement;
}

}  // namespace krot::internal
