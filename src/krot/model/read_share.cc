#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

#include "krot/base/system.h"
#include "krot/context.h"
#include "krot/model.h"
#include "krot/model/derived_models.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

// Something is not as it is in a valid model that agrees with itself. What it
// is, reading the whole model tells.
struct NeedsWhole {};

void Require(bool is_as_expected) {
  if (!is_as_expected) throw NeedsWhole();
}

// Reads packed little-endian values of a file one after another, with a
// mebibyte of it in memory. Throws NeedsWhole at the file's end.
class FileWindow {
 public:
  explicit FileWindow(const fs::path& path)
      : file_(path, FileDescriptor::Use::kRead) {
    Require(file_.is_open());
    const std::optional<int64_t> size = file_.RegularSize();
    Require(size.has_value());
    size_ = static_cast<uint64_t>(*size);
  }

  uint64_t offset() const { return offset_; }
  uint64_t BytesLeft() const { return size_ - offset_; }
  void Seek(uint64_t offset) {
    Require(offset <= size_);
    offset_ = offset;
  }
  void Skip(uint64_t num_bytes) {
    Require(num_bytes <= BytesLeft());
    offset_ += num_bytes;
  }

  template <typename T>
  void ReadArray(T* values, size_t count) {
    static_assert(std::is_trivially_copyable_v<T>);
    const size_t num_bytes = count * sizeof(T);
    if (num_bytes == 0) return;
    Fill(num_bytes);
    std::memcpy(values, window_.data() + (offset_ - begin_), num_bytes);
    offset_ += num_bytes;
  }
  template <typename T>
  T Read() {
    T value;
    ReadArray(&value, 1);
    return value;
  }
  // A number of records of so many bytes each, or more.
  size_t ReadCount(uint64_t record_bytes) {
    const auto count = Read<uint64_t>();
    Require(count <= BytesLeft() / record_bytes);
    return count;
  }
  // The characters up to the next '\0', which is skipped as well.
  std::string ReadString() {
    std::string text;
    while (const char c = Read<char>()) text += c;
    return text;
  }

 private:
  static constexpr uint64_t kWindowBytes = 1 << 20;

  // Makes the next bytes part of the window.
  void Fill(size_t num_bytes) {
    Require(num_bytes <= BytesLeft());
    if (offset_ >= begin_ && offset_ + num_bytes <= begin_ + window_.size()) {
      return;
    }
    begin_ = offset_;
    const auto size = static_cast<size_t>(
        std::min(BytesLeft(), std::max<uint64_t>(num_bytes, kWindowBytes)));
    Require(file_.ReadAt(static_cast<int64_t>(begin_), size, &window_) &&
            window_.size() == size);
  }

  const FileDescriptor file_;
  uint64_t size_ = 0;
  uint64_t offset_ = 0;
  uint64_t begin_ = 0;  // of the window, in the file
  std::string window_;
};

// The smallest size of one record in bytes, with empty lists.
constexpr uint64_t kLeastImageBytes = 4 + 7 * 8 + 4 + 1 + 8;
constexpr uint64_t kLeastPointBytes = 8 + 24 + 3 + 8 + 8;

Pose StoredPose(FileWindow* file) {
  double values[7];
  file->ReadArray(values, 7);
  Pose pose;
  pose.quaternion_wxyz = {values[0], values[1], values[2], values[3]};
  pose.translation = {values[4], values[5], values[6]};
  return pose;
}

// Reads images without 2D points, and where these begin in the file.
std::vector<uint64_t> ReadImages(FileWindow* file, Model* model) {
  std::vector<uint64_t> offsets;
  model->images.resize(file->ReadCount(kLeastImageBytes));
  for (Image& image : model->images) {
    image.id = file->Read<uint32_t>();
    image.cam_from_world = StoredPose(file);
    image.camera_id = file->Read<uint32_t>();
    image.name = file->ReadString();
    offsets.push_back(file->offset());
    file->Skip(file->ReadCount(sizeof(Point2D)) * sizeof(Point2D));
  }
  Require(file->BytesLeft() == 0);
  return offsets;
}

std::vector<TrackLength> ReadTrackLengths(FileWindow* file) {
  std::vector<TrackLength> tracks(file->ReadCount(kLeastPointBytes));
  for (TrackLength& track : tracks) {
    track.id = file->Read<uint64_t>();
    file->Skip(kLeastPointBytes - 16);
    track.length = file->ReadCount(sizeof(TrackElement));
    file->Skip(track.length * sizeof(TrackElement));
  }
  Require(file->BytesLeft() == 0);
  return tracks;
}

bool HasObservations(const std::vector<TrackLength>& tracks) {
  return std::any_of(tracks.begin(), tracks.end(),
                     [](const TrackLength& track) { return track.length > 0; });
}

// Reads these points, whose indices ascend.
void ReadPoints(FileWindow* file, const std::vector<TrackLength>& tracks,
                const std::vector<int32_t>& points, Model* model) {
  uint64_t total = 0;
  for (const int32_t k : points) total += tracks[k].length;
  model->points3D.reserve(points.size());
  model->track_elements.reserve(total);
  file->Seek(sizeof(uint64_t));
  int32_t next = 0;
  for (const int32_t k : points) {
    for (; next < k; ++next) {
      file->Skip(kLeastPointBytes + tracks[next].length * sizeof(TrackElement));
    }
    ++next;
    Point3D& point = model->points3D.emplace_back();
    point.id = file->Read<uint64_t>();
    file->ReadArray(point.xyz.data(), 3);
    file->ReadArray(point.color.data(), 3);
    point.error = file->Read<double>();
    const auto length = file->Read<uint64_t>();
    point.track_begin = model->track_elements.size();
    point.track_end = point.track_begin + length;
    model->track_elements.resize(point.track_end);
    file->ReadArray(model->track_elements.data() + point.track_begin, length);
  }
}

// Renumbers the 2D points that tracks name, as TakeShare does. They get the ids
// of their 3D points, and no coordinates.
void Renumber(ModelShare* share) {
  Model& model = share->model;
  const IdIndex<ImageId> images(model.images);
  std::vector<size_t> counts(model.images.size());
  for (const TrackElement& element : model.track_elements) {
    const std::optional<int32_t> n = images.Find(element.image_id);
    Require(n.has_value());
    ++counts[*n];
  }
  share->point2D_of.resize(counts.size());
  for (size_t n = 0; n < counts.size(); ++n) {
    share->point2D_of[n].reserve(counts[n]);
    model.images[n].points2D.reserve(counts[n]);
  }
  for (const Point3D& point : model.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      TrackElement& element = model.track_elements[e];
      const int32_t n = *images.Find(element.image_id);
      std::vector<uint32_t>& names = share->point2D_of[n];
      names.push_back(element.point2D_idx);
      element.point2D_idx = static_cast<uint32_t>(names.size() - 1);
      model.images[n].points2D.push_back({0, 0, point.id});
    }
  }
}

// The ids that are a share's to check: those of its points, and all that no
// point has between them and the next share's.
struct IdRange {
  Point3DId begin, end;

  bool Has(Point3DId id) const { return begin <= id && id < end; }
};

IdRange RangeOf(const std::vector<TrackLength>& tracks,
                const std::vector<std::vector<int32_t>>& cut, int rank) {
  const auto least_id = [&](int share) {
    Point3DId id = kInvalidPoint3DId;
    for (const int32_t k : cut[share]) id = std::min(id, tracks[k].id);
    return id;
  };
  if (cut[rank].empty()) return {0, 0};
  IdRange range = {0, kInvalidPoint3DId};
  for (int share = 0; share < rank; ++share) {
    if (!cut[share].empty()) range.begin = least_id(rank);
  }
  for (size_t share = cut.size() - 1; static_cast<int>(share) > rank; --share) {
    if (!cut[share].empty()) range.end = least_id(static_cast<int>(share));
  }
  return range;
}

// Reads the coordinates of an image's 2D points, and checks that tracks and
// image agree on which of them see the points of the share.
void TakePoints2D(FileWindow* file, const IdRange& range,
                  const std::vector<uint32_t>& names, Image* image) {
  std::vector<Point2D> points2D(file->Read<uint64_t>());
  file->ReadArray(points2D.data(), points2D.size());
  std::vector<char> is_claimed(points2D.size(), 0);
  for (size_t i = 0; i < names.size(); ++i) {
    Require(names[i] < points2D.size() && !is_claimed[names[i]]);
    is_claimed[names[i]] = 1;
    const Point2D& point2D = points2D[names[i]];
    Require(point2D.point3D_id == image->points2D[i].point3D_id);
    image->points2D[i] = point2D;
  }
  for (size_t i = 0; i < points2D.size(); ++i) {
    Require(std::isfinite(points2D[i].x) && std::isfinite(points2D[i].y));
    Require(is_claimed[i] || !range.Has(points2D[i].point3D_id));
  }
}

ModelShare ReadOwn(const fs::path& folder, int count, int rank) {
  ModelShare share;
  Model& model = share.model;
  model = ReadWithoutImages(folder, ModelFormat::kBinary);
  FileWindow images(folder / "images.bin");
  const std::vector<uint64_t> offsets = ReadImages(&images, &model);
  CompleteRigs(&model);

  FileWindow points(folder / "points3D.bin");
  const std::vector<TrackLength> tracks = ReadTrackLengths(&points);
  Require(HasObservations(tracks) && !IdIndex<Point3DId>(tracks).duplicate());
  const std::vector<std::vector<int32_t>> cut = CutPoints(tracks, count);
  ReadPoints(&points, tracks, cut[rank], &model);
  Renumber(&share);
  const IdRange range = RangeOf(tracks, cut, rank);
  for (size_t n = 0; n < offsets.size(); ++n) {
    images.Seek(offsets[n]);
    TakePoints2D(&images, range, share.point2D_of[n], &model.images[n]);
  }
  ValidateModel(model);
  return share;
}

}  // namespace

std::optional<ModelShare> ReadShare(const fs::path& folder, int count,
                                    int rank) {
  try {
    return ReadOwn(folder, count, rank);
  } catch (const NeedsWhole&) {
    return std::nullopt;
  } catch (const ModelError&) {
    return std::nullopt;
  }
}

}  // namespace krot::internal
