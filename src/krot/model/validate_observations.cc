#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "krot/model/validate_parts.h"

namespace krot {
namespace {

// The position of the image that an element of the point's track names; its
// 2D point exists.
int32_t ResolveTrackElement(const IndexedModel& model, const Point3D& point,
                            const TrackElement& element) {
  const std::optional<int32_t> position = model.images.Find(element.image_id);
  if (!position) {
    Fail("3D point ", point.id, ": found image id ", element.image_id,
         " in its track, expected one that exists in images");
  }
  const Image& image = model.records.images[*position];
  if (element.point2D_idx >= image.points2D.size()) {
    Fail("3D point ", point.id, ": found 2D point ", element.point2D_idx,
         " of ", Describe(image), " in its track, but that image has only ",
         image.points2D.size(), " 2D points");
  }
  return *position;
}

void CheckNamesPoint(const Image& image, uint32_t point2D_idx,
                     const Point3D& point) {
  const Point3DId named = image.points2D[point2D_idx].point3D_id;
  if (named == point.id) return;
  Fail("3D point ", point.id, ": found 2D point ", point2D_idx, " of ",
       Describe(image), " in its track, but that 2D point names ",
       named == kInvalidPoint3DId ? std::string("no 3D point")
                                  : "3D point " + std::to_string(named));
}

// Every 2D point with a 3D point was claimed by a track.
void CheckAllClaimed(const Image& image, const std::vector<bool>& claimed,
                     const IdIndex<Point3DId>& points3D) {
  for (size_t i = 0; i < claimed.size(); ++i) {
    const Point3DId id = image.points2D[i].point3D_id;
    if (claimed[i] || id == kInvalidPoint3DId) continue;
    if (!points3D.Find(id)) {
      Fail(Describe(image), ": found 3D point id ", id, " at 2D point ", i,
           ", expected one that exists in points3D");
    }
    Fail(Describe(image), ": found 3D point ", id, " at 2D point ", i,
         ", but the track of that 3D point does not name this 2D point");
  }
}

}  // namespace

void ValidateObservations(const IndexedModel& model) {
  const std::vector<Image>& images = model.records.images;
  const std::vector<Point3D>& points3D = model.records.points3D;
  const bool sets_anything =
      std::any_of(points3D.begin(), points3D.end(), [](const Point3D& point) {
        return point.track_end - point.track_begin >= 2;
      });

  std::vector<std::vector<bool>> claimed(images.size());
  for (size_t i = 0; i < images.size(); ++i) {
    claimed[i].resize(images[i].points2D.size());
  }
  for (const Point3D& point : points3D) {
    for (uint64_t i = point.track_begin; i < point.track_end; ++i) {
      const TrackElement& element = model.records.track_elements[i];
      const int32_t position = ResolveTrackElement(model, point, element);
      if (!sets_anything) continue;
      CheckNamesPoint(images[position], element.point2D_idx, point);
      if (claimed[position][element.point2D_idx]) {
        Fail("3D point ", point.id, ": found 2D point ", element.point2D_idx,
             " of ", Describe(images[position]),
             " twice in its track, expected once");
      }
      claimed[position][element.point2D_idx] = true;
    }
  }
  if (!sets_anything) return;
  for (size_t i = 0; i < images.size(); ++i) {
    CheckAllClaimed(images[i], claimed[i], model.points3D);
  }
}

}  // namespace krot
