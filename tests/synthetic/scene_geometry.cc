#include "tests/synthetic/scene_geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"

namespace krot::internal {
namespace {

constexpr int kPanorama = 17;

// Longitude and latitude, the axis in the middle.
Eigen::Vector2d ProjectToPanorama(const Camera& camera,
                                  const Eigen::Vector3d& x_cam) {
  const double longitude = std::atan2(x_cam.x(), x_cam.z());
  const double latitude = std::asin(x_cam.y() / x_cam.norm());
  return {camera.params[0] * (0.5 + longitude / (2 * kPi)),
          camera.params[1] * (0.5 + latitude / kPi)};
}

}  // namespace

std::vector<SceneObservation> RecomputeObservations(const Model& model) {
  std::vector<SceneObservation> observations;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const Point3D& point = model.points3D[k];
    for (uint64_t n = point.track_begin; n < point.track_end; ++n) {
      const TrackElement& element = model.track_elements.at(n);
      const Image& image = model.images.at(element.image_id - 1);
      const Camera& camera = model.cameras.at(image.camera_id - 1);
      const Point2D& point2D = image.points2D.at(element.point2D_idx);
      const Eigen::Vector3d x_cam =
          image.cam_from_world.Rotation() * point.xyz +
          image.cam_from_world.translation;
      SceneObservation observation;
      observation.image = element.image_id - 1;
      observation.point = k;
      observation.depth = x_cam.z();
      observation.measured = {point2D.x, point2D.y};
      observation.projected = camera.model_id == kPanorama
                                  ? ProjectToPanorama(camera, x_cam)
                                  : ProjectRay(camera, x_cam.hnormalized());
      observations.push_back(observation);
    }
  }
  return observations;
}

double MaxErrorPx(const Model& model) {
  double max_error_px = 0;
  for (const SceneObservation& o : RecomputeObservations(model)) {
    max_error_px = std::max(max_error_px, o.ErrorPx());
  }
  return max_error_px;
}

double MinDepth(const Model& model) {
  double min_depth = std::numeric_limits<double>::infinity();
  for (const SceneObservation& o : RecomputeObservations(model)) {
    min_depth = std::min(min_depth, o.depth);
  }
  return min_depth;
}

}  // namespace krot::internal
