#include <cmath>
#include <optional>

#include "krot/model/validate_parts.h"

namespace krot::internal {
namespace {

// Ends a sentence about a track element of a 2D point that does not exist.
constexpr const char* kHowToReadTheRest =
    "; --Model.on_contradiction follow_images reads the rest";

void CheckTrackElement(const IndexedModel& model, const Point3D& point,
                       const TrackElement& element) {
  const std::optional<int32_t> position = model.images.Find(element.image_id);
  if (!position) {
    Fail("3D point ", point.id, ": found image id ", element.image_id,
         " in its track, expected one that exists in images",
         kHowToReadTheRest);
  }
  const Image& image = model.records.images[*position];
  if (element.point2D_idx >= image.points2D.size()) {
    Fail("3D point ", point.id, ": found 2D point ", element.point2D_idx,
         " of ", Describe(image), " in its track, but that image has only ",
         image.points2D.size(), " 2D points", kHowToReadTheRest);
  }
  const Point2D& pixel = image.points2D[element.point2D_idx];
  for (const double value : {pixel.x, pixel.y}) {
    if (std::isfinite(value)) continue;
    Fail("3D point ", point.id, ": found 2D point ", element.point2D_idx,
         " of ", Describe(image), " in its track, a coordinate of which is ",
         value, ", expected a finite number");
  }
}

}  // namespace

void ValidateObservations(const IndexedModel& model) {
  for (const Point3D& point : model.records.points3D) {
    for (uint64_t i = point.track_begin; i < point.track_end; ++i) {
      CheckTrackElement(model, point, model.records.track_elements[i]);
    }
  }
}

}  // namespace krot::internal
