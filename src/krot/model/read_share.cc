#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "krot/context.h"
#include "krot/model.h"
#include "krot/model/derived_models.h"
#include "krot/model/formats.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

namespace fs = std::filesystem;

// Throws if something is not as it is in a valid model that agrees with itself.
// What it is, reading the whole model tells: nobody reads this sentence.
void Require(bool is_as_expected) {
  if (!is_as_expected) throw ModelError(std::string());
}

// Reads images without 2D points, and where these begin in the file.
std::vector<size_t> ReadImages(BinaryReader* file, Model* model) {
  std::vector<size_t> offsets;
  model->images.resize(
      file->ReadCount<uint64_t>(kImageBytes, "number of images"));
  for (Image& image : model->images) {
    ReadImageHead(file, &image);
    offsets.push_back(file->offset());
    file->Skip(sizeof(Point2D) * file->ReadCount<uint64_t>(
                                     sizeof(Point2D), "number of 2D points"));
  }
  file->ExpectEnd();
  return offsets;
}

std::vector<TrackLength> ReadTrackLengths(BinaryReader* file) {
  std::vector<TrackLength> tracks(
      file->ReadCount<uint64_t>(kPoint3DBytes, "number of 3D points"));
  for (TrackLength& track : tracks) {
    Require(file->BytesLeft() >= kPoint3DBytes);
    track.id = file->Read<uint64_t>("a 3D point id");
    file->Skip(kPoint3DBytes - 16);
    track.length =
        file->ReadCount<uint64_t>(sizeof(TrackElement), "track length");
    file->Skip(track.length * sizeof(TrackElement));
  }
  file->ExpectEnd();
  return tracks;
}

bool HasObservations(const std::vector<TrackLength>& tracks) {
  return std::any_of(tracks.begin(), tracks.end(),
                     [](const TrackLength& track) { return track.length > 0; });
}

// Reads these points, whose indices ascend.
void ReadPoints(BinaryReader* file, const std::vector<TrackLength>& tracks,
                const std::vector<int32_t>& points, Model* model) {
  uint64_t total = 0;
  for (const int32_t k : points) total += tracks[k].length;
  model->points3D.reserve(points.size());
  model->track_elements.reserve(total);
  file->Seek(sizeof(uint64_t));
  int32_t next = 0;
  for (const int32_t k : points) {
    for (; next < k; ++next) {
      file->Skip(kPoint3DBytes + tracks[next].length * sizeof(TrackElement));
    }
    ++next;
    ReadPoint3D(file, &model->points3D.emplace_back(), &model->track_elements);
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
void TakePoints2D(BinaryReader* file, const IdRange& range,
                  const std::vector<uint32_t>& names, Image* image) {
  std::vector<Point2D> points2D;
  ReadPoints2D(file, &points2D);
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
  BinaryReader images(folder / "images.bin");
  const std::vector<size_t> offsets = ReadImages(&images, &model);
  CompleteRigs(&model);

  BinaryReader points(folder / "points3D.bin");
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
  } catch (const ModelError&) {
    return std::nullopt;
  }
}

}  // namespace krot::internal
