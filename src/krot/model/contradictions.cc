#include "krot/model/model_checks.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

// What the named 2D point says to a track element: it names the same 3D point;
// another one or none; that element has come before; or it does not exist.
enum class Claim { kConfirmed, kUnconfirmed, kRepeated, kNonexistent };

// Judges the track elements one by one and remembers the confirmed 2D points.
class Claims {
 public:
  explicit Claims(const Model& model)
      : model_(model), images_(model.images), claimed_(model.images.size()) {
    for (size_t n = 0; n < claimed_.size(); ++n) {
      claimed_[n].resize(model.images[n].points2D.size());
    }
  }

  Claim Take(const Point3D& point, const TrackElement& element) {
    const std::optional<int32_t> n = images_.Find(element.image_id);
    if (!n || element.point2D_idx >= claimed_[*n].size()) {
      return Claim::kNonexistent;
    }
    const Image& image = model_.images[*n];
    if (image.points2D[element.point2D_idx].point3D_id != point.id) {
      return Claim::kUnconfirmed;
    }
    if (claimed_[*n][element.point2D_idx]) return Claim::kRepeated;
    claimed_[*n][element.point2D_idx] = true;
    return Claim::kConfirmed;
  }

  // Calls `act(image, point2D_idx)`, with the index of each, for every 2D point
  // that names a 3D point but that no element has claimed.
  template <typename Act>
  void ForEachUnclaimed(const Act& act) const {
    for (size_t n = 0; n < claimed_.size(); ++n) {
      const std::vector<Point2D>& points2D = model_.images[n].points2D;
      for (size_t i = 0; i < points2D.size(); ++i) {
        if (claimed_[n][i] || points2D[i].point3D_id == kInvalidPoint3DId) {
          continue;
        }
        act(n, static_cast<uint32_t>(i));
      }
    }
  }

  // `2D point 3 of image 1 ("a.jpg") in its track, but ...`
  std::string Describe(Claim claim, const TrackElement& element) const {
    const std::string place = "2D point " + std::to_string(element.point2D_idx);
    const std::optional<int32_t> n = images_.Find(element.image_id);
    if (claim == Claim::kNonexistent) {
      return place + " of image " + std::to_string(element.image_id) +
             " in its track, which does not exist";
    }
    const Image& image = model_.images[*n];
    const std::string where = place + " of " + internal::Describe(image);
    if (claim == Claim::kRepeated) {
      return where + " twice in its track, expected once";
    }
    const Point3DId named = image.points2D[element.point2D_idx].point3D_id;
    return where + " in its track, but that 2D point names " +
           (named == kInvalidPoint3DId ? std::string("no 3D point")
                                       : "3D point " + std::to_string(named));
  }

 private:
  const Model& model_;
  IdIndex<ImageId> images_;
  std::vector<std::vector<bool>> claimed_;
};

std::string DescribeUnclaimed(const Image& image, uint32_t point2D_idx,
                              bool exists) {
  const std::string found =
      std::to_string(image.points2D[point2D_idx].point3D_id) + " at 2D point " +
      std::to_string(point2D_idx);
  return Describe(image) +
         (exists ? ": found 3D point " + found +
                       ", but the track of that 3D point does not name this "
                       "2D point"
                 : ": found 3D point id " + found +
                       ", expected one that exists in points3D");
}

// 2D points name no 3D point if no track confirms it.
void DropUnconfirmedNames(Model* model) {
  Claims claims(*model);
  for (const Point3D& point : model->points3D) {
    for (const TrackElement& element : TrackOf(*model, point)) {
      claims.Take(point, element);
    }
  }
  claims.ForEachUnclaimed([&](size_t n, uint32_t i) {
    model->images[n].points2D[i].point3D_id = kInvalidPoint3DId;
  });
}

// 2D points that name no 3D point get the first one whose track contains them.
void NameByTracks(Model* model) {
  const IdIndex<ImageId> images(model->images);
  for (const Point3D& point : model->points3D) {
    for (const TrackElement& element : TrackOf(*model, point)) {
      const std::optional<int32_t> n = images.Find(element.image_id);
      if (!n) continue;
      std::vector<Point2D>& points2D = model->images[*n].points2D;
      if (element.point2D_idx >= points2D.size()) continue;
      Point3DId& named = points2D[element.point2D_idx].point3D_id;
      if (named == kInvalidPoint3DId) named = point.id;
    }
  }
}

// Rebuilds every track from the elements that are kept and, behind them, those
// of `missing`, by point; `missing` may be empty.
void RebuildTracks(const std::vector<char>& is_kept,
                   const std::vector<std::vector<TrackElement>>& missing,
                   Model* model) {
  std::vector<TrackElement> elements;
  for (size_t k = 0; k < model->points3D.size(); ++k) {
    Point3D& point = model->points3D[k];
    const size_t begin = elements.size();
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (is_kept[e]) elements.push_back(model->track_elements[e]);
    }
    if (!missing.empty()) {
      elements.insert(elements.end(), missing[k].begin(), missing[k].end());
    }
    point.track_begin = begin;
    point.track_end = elements.size();
  }
  model->track_elements = std::move(elements);
}

}  // namespace

Contradictions FindContradictions(const Model& model) {
  Claims claims(model);
  Contradictions found;
  for (const Point3D& point : model.points3D) {
    for (const TrackElement& element : TrackOf(model, point)) {
      const Claim claim = claims.Take(point, element);
      if (claim == Claim::kConfirmed) continue;
      if (!found.Any()) {
        found.first = "3D point " + std::to_string(point.id) + ": found " +
                      claims.Describe(claim, element);
      }
      ++found.num_track_elements;
    }
  }
  const IdIndex<Point3DId> points3D(model.points3D);
  claims.ForEachUnclaimed([&](size_t n, uint32_t i) {
    const Image& image = model.images[n];
    if (!found.Any()) {
      const bool exists =
          points3D.Find(image.points2D[i].point3D_id).has_value();
      found.first = DescribeUnclaimed(image, i, exists);
    }
    ++found.num_points2D;
  });
  return found;
}

bool HasTrack(const Model& model) {
  return std::any_of(model.points3D.begin(), model.points3D.end(),
                     [](const Point3D& point) {
                       return point.track_end - point.track_begin >= 2;
                     });
}

void Follow(Reading reading, Model* model) {
  DropUnknownPoints3D(model);
  if (reading == Reading::kTracks) DropUnconfirmedNames(model);
  if (reading != Reading::kImages) NameByTracks(model);
  const IdIndex<Point3DId> points3D(model->points3D);
  Claims claims(*model);
  std::vector<char> is_kept;
  for (const Point3D& point : model->points3D) {
    for (const TrackElement& element : TrackOf(*model, point)) {
      is_kept.push_back(claims.Take(point, element) == Claim::kConfirmed);
    }
  }
  std::vector<std::vector<TrackElement>> missing(model->points3D.size());
  claims.ForEachUnclaimed([&](size_t n, uint32_t i) {
    const Image& image = model->images[n];
    missing[*points3D.Find(image.points2D[i].point3D_id)].push_back(
        {image.id, i});
  });
  RebuildTracks(is_kept, missing, model);
}

int64_t DropUnknownPoints2D(Model* model) {
  const IdIndex<ImageId> images(model->images);
  std::vector<char> is_kept;
  for (const TrackElement& element : model->track_elements) {
    const std::optional<int32_t> n = images.Find(element.image_id);
    is_kept.push_back(n &&
                      element.point2D_idx < model->images[*n].points2D.size());
  }
  const size_t count = model->track_elements.size();
  RebuildTracks(is_kept, {}, model);
  return static_cast<int64_t>(count - model->track_elements.size());
}

void DropUnknownPoints3D(Model* model) {
  const IdIndex<Point3DId> points3D(model->points3D);
  for (Image& image : model->images) {
    for (Point2D& point : image.points2D) {
      if (!points3D.Find(point.point3D_id)) {
        point.point3D_id = kInvalidPoint3DId;
      }
    }
  }
}

}  // namespace krot::internal
