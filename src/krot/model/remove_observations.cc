#include "krot/model/remove_observations.h"

#include <algorithm>
#include <unordered_set>
#include <utility>

#include "krot/base/check.h"
#include "krot/model/image_geometry.h"

namespace krot::internal {

RemovedObservations RemoveObservations(const Model& model,
                                       const std::vector<char>& is_removed) {
  CheckArgument(is_removed.size() == model.track_elements.size(),
                "is_removed.size()", is_removed.size(),
                "the number of track elements");
  RemovedObservations result;
  result.model = model;
  result.model.points3D.clear();
  result.model.track_elements.clear();
  const auto image_of = ImageIndices(model);
  const auto point2D_of = [&](const TrackElement& element) -> Point2D& {
    return result.model.images[image_of.at(element.image_id)]
        .points2D[element.point2D_idx];
  };
  for (const Point3D& point : model.points3D) {
    int64_t num_kept = 0;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      num_kept += !is_removed[e];
    }
    const bool goes = num_kept < 2;
    if (goes) {
      ++result.num_points;
      result.num_left_alone += num_kept;
    }
    // A track may hold a 2D point twice.
    std::vector<Point2D*> named;
    std::vector<Point2D*> stay;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      Point2D& point2D = point2D_of(model.track_elements[e]);
      if (point2D.point3D_id != point.id) continue;
      named.push_back(&point2D);
      if (!goes && !is_removed[e]) stay.push_back(&point2D);
    }
    for (Point2D* point2D : named) point2D->point3D_id = kInvalidPoint3DId;
    for (Point2D* point2D : stay) point2D->point3D_id = point.id;
    if (goes) continue;
    Point3D kept = point;
    kept.track_begin = result.model.track_elements.size();
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!is_removed[e]) {
        result.model.track_elements.push_back(model.track_elements[e]);
        result.element_of.push_back(e);
      }
    }
    kept.track_end = result.model.track_elements.size();
    result.model.points3D.push_back(kept);
  }
  return result;
}

Model RemoveImages(const Model& model, const std::vector<char>& is_removed) {
  CheckArgument(is_removed.size() == model.images.size(), "is_removed.size()",
                is_removed.size(), "the number of images");
  Model result = model;
  result.images.clear();
  std::unordered_set<uint64_t> gone;
  for (size_t n = 0; n < model.images.size(); ++n) {
    if (is_removed[n]) {
      gone.insert(model.images[n].id);
    } else {
      result.images.push_back(model.images[n]);
    }
  }
  result.frames.clear();
  for (Frame frame : model.frames) {
    const size_t num_data = frame.data.size();
    frame.data.erase(std::remove_if(frame.data.begin(), frame.data.end(),
                                    [&](const FrameData& data) {
                                      return data.sensor_id.type ==
                                                 kSensorTypeCamera &&
                                             gone.count(data.data_id) > 0;
                                    }),
                     frame.data.end());
    const bool has_image = std::any_of(
        frame.data.begin(), frame.data.end(), [](const FrameData& data) {
          return data.sensor_id.type == kSensorTypeCamera;
        });
    if (has_image || frame.data.size() == num_data) {
      result.frames.push_back(std::move(frame));
    }
  }
  return result;
}

}  // namespace krot::internal
