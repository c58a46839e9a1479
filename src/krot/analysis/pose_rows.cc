#include "krot/analysis/pose_rows.h"

#include <utility>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/geometry/transform.h"

namespace krot::internal {
namespace {

using Matrix23 = Eigen::Matrix<double, 2, 3>;

}  // namespace

PoseRows::PoseRows(const Model& model, const ModelNoise& noise)
    : model_(model),
      noise_(noise),
      geometries_(ImageGeometries(model)),
      image_of_(ImagesOfElements(model)),
      nearest_(model.images.size(), 0) {
  std::vector<std::vector<double>> distances(model.images.size());
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const Point3D& point = model.points3D[k];
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const int32_t n = image_of_[e];
      if (!geometries_[n].has_pose) continue;
      distances[n].push_back(
          (geometries_[n].cam_from_world * noise.points[k]).norm());
    }
  }
  for (size_t n = 0; n < distances.size(); ++n) {
    if (distances[n].empty()) continue;
    // A nearer point would drown all others in rounding.
    nearest_[n] = 1e-6 * Median(std::move(distances[n]));
  }
}

std::vector<PoseRow> PoseRows::Of(size_t k) const {
  const Point3D& point = model_.points3D[k];
  std::vector<PoseRow> rows;
  for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
    if (noise_.observations[e].num_controlled == 0) continue;
    const int32_t n = image_of_[e];
    const RigidTransform& pose = geometries_[n].cam_from_world;
    const Camera& camera = model_.cameras[geometries_[n].camera];
    const Point2D& pixel =
        model_.images[n].points2D[model_.track_elements[e].point2D_idx];
    PoseRow row;
    row.x_cam = pose * noise_.points[k];
    if (!(row.x_cam.norm() > nearest_[n])) continue;
    const auto E = RowAtProjection(camera, {pixel.x, pixel.y}, row.x_cam);
    if (!E) continue;
    const double depth = E->row(0).dot(row.x_cam);
    row.element = e;
    row.image = n;
    row.error = noise_.observations[e].error_px;
    const Matrix23 by_cam =
        (E->bottomRows<2>() -
         E->bottomRows<2>() * row.x_cam / depth * E->row(0)) /
        depth;
    row.F << -by_cam * CrossMatrix(row.x_cam), -by_cam * pose.rotation;
    if (row.F.allFinite()) rows.push_back(row);
  }
  if (rows.size() < 2) rows.clear();
  return rows;
}

}  // namespace krot::internal
