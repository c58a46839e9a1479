#include "krot/proof/fixed_constants.h"

namespace krot {
namespace {

using Real = FixedConstants::Real;
using Vector3 = FixedConstants::Vector3;

Real SizeOf(const Vector3& x) { return x.cwiseAbs().sum(); }

}  // namespace

FixedConstants::FixedConstants(const KnownRotationProblem& problem)
    : problem_(problem) {
  for (const Observation& observation : problem.observations) {
    const View& view = problem.views[observation.view];
    if (!problem.IsFixedFrame(view.frame)) continue;
    const Part minus_origin = OfFrame(view);  // in the camera, of O = 0
    origin_frame_ = view.frame;
    origin_ = -(view.cam_from_world_rotation.transpose().cast<Real>() *
                minus_origin.x_cam);
    origin_size_ = minus_origin.size + SizeOf(origin_);
    return;
  }
  for (const std::optional<Eigen::Vector3d>& point : problem.fixed_points) {
    if (!point) continue;
    origin_ = point->cast<Real>();
    return;
  }
}

FixedConstants::Part FixedConstants::OfFrame(const View& view) const {
  const Vector3 t = problem_.fixed_translations[view.frame]->cast<Real>();
  const Vector3 t_sr = view.cam_from_rig_translation.cast<Real>();
  return {view.cam_from_rig_rotation.cast<Real>() * t + t_sr +
              view.cam_from_world_rotation.cast<Real>() * origin_,
          SizeOf(t) + SizeOf(t_sr) + origin_size_};
}

FixedConstants::Part FixedConstants::OfPoint(const View& view,
                                             int32_t point) const {
  if (!problem_.IsFixedPoint(point)) return {};
  const Vector3 x = problem_.fixed_points[point]->cast<Real>() - origin_;
  return {view.cam_from_world_rotation.cast<Real>() * x,
          SizeOf(x) + origin_size_};
}

}  // namespace krot
