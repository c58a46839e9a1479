#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "krot/context.h"
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

// ---- What the parts of ValidateModel share ----

// A model and indices of its ids.
struct IndexedModel {
  explicit IndexedModel(const Model& model)
      : records(model),
        cameras(model.cameras),
        rigs(model.rigs),
        frames(model.frames),
        images(model.images),
        points3D(model.points3D) {}

  const Model& records;
  IdIndex<CameraId> cameras;
  IdIndex<RigId> rigs;
  IdIndex<FrameId> frames;
  IdIndex<ImageId> images;
  IdIndex<Point3DId> points3D;
};

// Checks rigs and frames as ValidateModel promises, but not that their ids are
// unique.
void ValidateRigsAndFrames(const IndexedModel& model);
// Checks that tracks refer to existing 2D points. Requires valid track ranges.
void ValidateObservations(const IndexedModel& model);

// Joins the parts into a message and throws it as a ModelError.
template <typename... Parts>
[[noreturn]] void Fail(const Parts&... parts) {
  std::ostringstream message;
  message.precision(17);
  (message << ... << parts);
  throw ModelError(message.str());
}

// `image 3 ("a.jpg")`.
inline std::string Describe(const Image& image) {
  return "image " + std::to_string(image.id) + " (\"" + image.name + "\")";
}

// Fails unless the value is finite; `owner()` names the record that it belongs
// to.
template <typename Owner>
void CheckFinite(double value, const Owner& owner, const char* quantity) {
  if (std::isfinite(value)) return;
  Fail(owner(), ": found ", quantity, " ", value, ", expected a finite number");
}

}  // namespace krot::internal
