#include "krot/model/model_share.h"

#include <algorithm>
#include <numeric>

#include "krot/model/image_geometry.h"

namespace krot::internal {

std::vector<std::vector<int32_t>> CutPoints(const Model& whole, int count) {
  std::vector<int32_t> by_id(whole.points3D.size());
  std::iota(by_id.begin(), by_id.end(), 0);
  std::sort(by_id.begin(), by_id.end(), [&](int32_t a, int32_t b) {
    return whole.points3D[a].id < whole.points3D[b].id;
  });
  std::vector<std::vector<int32_t>> cut(count);
  const auto total = static_cast<int64_t>(whole.track_elements.size());
  // The observations of all shares up to this one.
  const auto end_of = [&](int share) { return total * (share + 1) / count; };
  int64_t sum = 0;
  int share = 0;
  for (const int32_t k : by_id) {
    while (share + 1 < count && sum >= end_of(share)) ++share;
    cut[share].push_back(k);
    const Point3D& point = whole.points3D[k];
    sum += static_cast<int64_t>(point.track_end - point.track_begin);
  }
  for (std::vector<int32_t>& points : cut) {
    std::sort(points.begin(), points.end());
  }
  return cut;
}

ModelShare TakeShare(const Model& whole, const std::vector<int32_t>& points) {
  ModelShare share;
  Model& model = share.model;
  model.stores_rigs = whole.stores_rigs;
  model.cameras = whole.cameras;
  model.rigs = whole.rigs;
  model.frames = whole.frames;
  model.images.reserve(whole.images.size());
  for (const Image& image : whole.images) {
    model.images.push_back(
        {image.id, image.cam_from_world, image.camera_id, image.name, {}});
  }
  const auto image_indices = ImageIndices(whole);
  share.point2D_of.resize(whole.images.size());
  model.points3D.reserve(points.size());
  for (const int32_t k : points) {
    Point3D point = whole.points3D[k];
    const uint64_t begin = model.track_elements.size();
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = whole.track_elements[e];
      const int32_t n = image_indices.at(element.image_id);
      std::vector<uint32_t>& names = share.point2D_of[n];
      model.track_elements.push_back(
          {element.image_id, static_cast<uint32_t>(names.size())});
      names.push_back(element.point2D_idx);
      model.images[n].points2D.push_back(
          whole.images[n].points2D[element.point2D_idx]);
    }
    point.track_begin = begin;
    point.track_end = model.track_elements.size();
    model.points3D.push_back(point);
  }
  return share;
}

}  // namespace krot::internal
