#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/geometry.h"
#include "krot/model.h"

namespace krot::internal {

// Finds records (cameras, images, points3D, ...) by their id.
//
//   const IdIndex<ImageId> image_index(model.images);
//   const std::optional<int32_t> i = image_index.Find(image_id);
//
// COLMAP's ids are nearly consecutive: then Find is one look-up in a table,
// otherwise a binary search. If several records have the same id, the first one
// counts. Building costs O(n), O(n log n) for sparse ids.
template <typename Id>
class IdIndex {
 public:
  template <typename Record>
  explicit IdIndex(const std::vector<Record>& records) {
    uint64_t max_id = 0;
    for (const Record& record : records) {
      max_id = std::max<uint64_t>(max_id, record.id);
    }
    if (max_id <= 4 * records.size() + 1024) {
      FillTable(records, max_id);
    } else {
      FillSorted(records);
    }
  }

  // The index of the record with this id; none if there is no such record.
  std::optional<int32_t> Find(Id id) const {
    if (!table_.empty()) {
      if (id >= table_.size() || table_[id] < 0) return std::nullopt;
      return table_[id];
    }
    const auto entry = std::lower_bound(sorted_.begin(), sorted_.end(),
                                        std::pair<Id, int32_t>(id, 0));
    if (entry == sorted_.end() || entry->first != id) return std::nullopt;
    return entry->second;
  }

  // An id that several records share; none if all differ.
  std::optional<Id> duplicate() const { return duplicate_; }

 private:
  template <typename Record>
  void FillTable(const std::vector<Record>& records, uint64_t max_id) {
    table_.assign(max_id + 1, -1);
    for (size_t i = 0; i < records.size(); ++i) {
      int32_t& position = table_[records[i].id];
      if (position >= 0) {
        duplicate_ = records[i].id;
      } else {
        position = static_cast<int32_t>(i);
      }
    }
  }

  template <typename Record>
  void FillSorted(const std::vector<Record>& records) {
    sorted_.reserve(records.size());
    for (size_t i = 0; i < records.size(); ++i) {
      sorted_.emplace_back(records[i].id, static_cast<int32_t>(i));
    }
    std::sort(sorted_.begin(), sorted_.end());
    for (size_t i = 1; i < sorted_.size(); ++i) {
      if (sorted_[i].first == sorted_[i - 1].first) {
        duplicate_ = sorted_[i].first;
      }
    }
  }

  std::vector<int32_t> table_;                  // by id, -1 for none
  std::vector<std::pair<Id, int32_t>> sorted_;  // if there is no table
  std::optional<Id> duplicate_;
};

// `image 3 ("a.jpg")`.
inline std::string Describe(const Image& image) {
  return "image " + std::to_string(image.id) + " (\"" + image.name + "\")";
}

// The pose of an image: x_cam = cam_from_rig * (rig_from_world * x_world).
//
// It follows from the frame's pose and the rig's calibration, as in COLMAP
// since 3.12; the pose in the images file is ignored.
struct ImageGeometry {
  int32_t camera = -1;  // index in Model::cameras
  // Index in Model::frames; -1 if the image belongs to no frame, or if its
  // sensor's pose in the rig is unknown.
  int32_t frame = -1;
  int32_t rig = -1;     // index in Model::rigs; -1 if frame is
  int32_t sensor = -1;  // index in Rig::sensors; -1: the reference sensor
  // False if frame is -1 or anything below is not finite.
  bool has_pose = false;
  RigidTransform rig_from_world;
  RigidTransform cam_from_rig;
  RigidTransform cam_from_world;  // the two composed
};

// The geometry of every image, in the order of Model::images. Requires a valid
// model (ValidateModel). O(images + frames).
std::vector<ImageGeometry> ImageGeometries(const Model& model);

// A pixel's ray, and its derivatives by the pixel's two coordinates.
struct PixelRay {
  Eigen::Vector3d ray;
  Eigen::Matrix<double, 3, 2> by_pixel;
};

inline PixelRay operator*(const Eigen::Matrix3d& rotation,
                          const PixelRay& pixel) {
  return {rotation * pixel.ray, rotation * pixel.by_pixel};
}

// The ray of a pixel in camera axes; none if no ray less than 90 degrees off
// the axis projects to the pixel, and for cameras without an image plane.
std::optional<PixelRay> RayOf(const Camera& camera,
                              const Eigen::Vector2d& pixel);

// The pose of a sensor in its rig.
struct SensorPlace {
  int32_t index = -1;                   // as ImageGeometry::sensor
  std::optional<Pose> sensor_from_rig;  // none: unknown
};

// Finds a sensor of the rig; none if it does not belong to it. O(sensors).
std::optional<SensorPlace> FindSensor(const Rig& rig,
                                      const SensorId& sensor_id);

// Index in Model::images by id.
std::unordered_map<ImageId, int32_t> ImageIndices(const Model& model);

// The same by name; of images that share a name the first one counts. The names
// are the model's own.
std::unordered_map<std::string_view, int32_t> ImagesByName(const Model& model);

// For each track element the index of its image.
std::vector<int32_t> ImagesOfElements(const Model& model);

// The track of one of the model's points.
struct Track {
  const TrackElement* first;
  const TrackElement* last;

  const TrackElement* begin() const { return first; }
  const TrackElement* end() const { return last; }
};
inline Track TrackOf(const Model& model, const Point3D& point) {
  const TrackElement* const all = model.track_elements.data();
  return {all + point.track_begin, all + point.track_end};
}

// Indices of the records in the order of their ids, which must be unique.
// Results that are computed in this order do not depend on the order in the
// file.
template <typename Record>
std::vector<int32_t> OrderOfIds(const std::vector<Record>& records) {
  auto order = NumbersUpTo<int32_t>(static_cast<int64_t>(records.size()));
  std::sort(order.begin(), order.end(), [&](int32_t a, int32_t b) {
    return records[a].id < records[b].id;
  });
  return order;
}

// The names of the sensor types -1, 0 and 1 in text files: INVALID, CAMERA,
// IMU. None for other types and names.
std::optional<std::string_view> SensorTypeName(int32_t type);
std::optional<int32_t> SensorTypeFromName(std::string_view name);

// Replaces the model's rigs and frames by trivial ones, as COLMAP does if the
// files hold none: a rig for every camera, which is its reference sensor, and a
// frame for every image, whose pose it gets to the bit. Rigs have the order and
// ids of the cameras, frames those of the images.
void UseTrivialRigs(Model* model);

// Gives every image the pose that its frame and rig say.
void FollowFrames(Model* model);

}  // namespace krot::internal
