#include "krot/outliers/list_removed.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "krot/model.h"
#include "krot/model/id_index.h"
#include "krot/model/image_geometry.h"

namespace krot::internal {
namespace {

constexpr double kNoError = std::numeric_limits<double>::quiet_NaN();

// The errors that the input's track elements have in the result; NaN where the
// point went.
std::vector<double> ErrorsAfter(const Model& input, const Model& kept,
                                const Context& context) {
  Model model = input;
  model.frames = kept.frames;
  for (size_t n = 0; n < model.images.size(); ++n) {
    model.images[n].cam_from_world = kept.images[n].cam_from_world;
  }
  const IdIndex<Point3DId> kept_points(kept.points3D);
  for (Point3D& point : model.points3D) {
    const std::optional<int32_t> k = kept_points.Find(point.id);
    point.xyz = k ? kept.points3D[*k].xyz : Eigen::Vector3d::Constant(kNoError);
  }
  return PixelErrors(model, context.num_threads);
}

}  // namespace

std::vector<RemovedObservation> ListRemoved(
    const Model& model, const Model& kept,
    const std::vector<double>& errors_before,
    const std::vector<char>& is_removed,
    const std::vector<int64_t>& conflict_of, const Context& context,
    const std::vector<double>& w) {
  std::vector<RemovedObservation> list;
  const std::vector<double> errors_after = ErrorsAfter(model, kept, context);
  const auto image_of = ImageIndices(model);
  for (const Point3D& point : model.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!is_removed[e]) continue;
      const TrackElement& element = model.track_elements[e];
      RemovedObservation removed;
      removed.image_id = element.image_id;
      removed.image_name = model.images[image_of.at(element.image_id)].name;
      removed.point2D_idx = element.point2D_idx;
      removed.point3D_id = point.id;
      removed.error_before_px = errors_before[e];
      removed.error_after_px = errors_after[e];
      if (conflict_of[e] >= 0) removed.conflict = conflict_of[e];
      if (!w.empty()) removed.w = w[e];
      list.push_back(std::move(removed));
    }
  }
  const auto key = [](const RemovedObservation& o) {
    return std::isnan(o.error_before_px)
               ? std::numeric_limits<double>::infinity()
               : o.error_before_px;
  };
  std::stable_sort(
      list.begin(), list.end(),
      [&](const RemovedObservation& a, const RemovedObservation& b) {
        return key(a) > key(b);
      });
  return list;
}

}  // namespace krot::internal
