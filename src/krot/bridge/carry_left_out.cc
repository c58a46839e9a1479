#include "krot/bridge/carry_left_out.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "krot/camera/projection_row.h"
#include "krot/minimax/residual.h"
#include "krot/model/image_geometry.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

// The largest error of a point's observations whose error was finite before;
// infinite where one of those no longer projects.
class TrackError {
 public:
  TrackError(const Model& model, const std::vector<double>& errors_before_px,
             Norm norm)
      : model_(model),
        errors_before_px_(errors_before_px),
        norm_(norm),
        images_(ImageGeometries(model)),
        image_indices_(ImageIndices(model)) {}

  double operator()(const Point3D& point, const Vector3d& xyz) const {
    double largest = 0;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!std::isfinite(errors_before_px_[e])) continue;
      const TrackElement& element = model_.track_elements[e];
      const int32_t n = image_indices_.at(element.image_id);
      const Point2D& point2D = model_.images[n].points2D[element.point2D_idx];
      const Camera& camera = model_.cameras[images_[n].camera];
      const auto error = ProjectionError(camera.model_id, camera.params.data(),
                                         {point2D.x, point2D.y},
                                         images_[n].cam_from_world * xyz);
      if (!error) return std::numeric_limits<double>::infinity();
      largest = std::max(largest, NormOf(*error, norm_));
    }
    return largest;
  }

  const std::vector<ImageGeometry>& images() const { return images_; }
  int32_t ImageOf(const TrackElement& element) const {
    return image_indices_.at(element.image_id);
  }

 private:
  const Model& model_;
  const std::vector<double>& errors_before_px_;
  const Norm norm_;
  const std::vector<ImageGeometry> images_;
  const std::unordered_map<ImageId, int32_t> image_indices_;
};

}  // namespace

void CarryLeftOutPoints(const Model& before,
                        const std::vector<double>& errors_px, Norm norm,
                        const BuiltProblem& built, const FixedParts& fixed,
                        double level, Model* after) {
  std::vector<char> is_in(before.points3D.size(), 0);
  for (const int32_t k : built.point_of) is_in[k] = 1;
  if (std::count(is_in.begin(), is_in.end(), 0) == 0) return;

  const TrackError error_before(before, errors_px, norm);
  const TrackError error_after(*after, errors_px, norm);
  for (size_t k = 0; k < is_in.size(); ++k) {
    if (is_in[k] || fixed.HasPoint(static_cast<int32_t>(k))) continue;
    Point3D& point = after->points3D[k];
    const Vector3d& start = before.points3D[k].xyz;
    const double allowed =
        std::max(level, error_before(before.points3D[k], start));
    double lowest = error_after(point, start);
    for (uint64_t e = point.track_begin;
         e < point.track_end && lowest > allowed; ++e) {
      const int32_t n = error_after.ImageOf(after->track_elements[e]);
      const Vector3d xyz =
          start + (Center(error_after.images()[n].cam_from_world) -
                   Center(error_before.images()[n].cam_from_world));
      const double error = error_after(point, xyz);
      if (!(error < lowest)) continue;
      lowest = error;
      point.xyz = xyz;
    }
  }
}

}  // namespace krot::internal
