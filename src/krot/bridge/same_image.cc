#include "krot/bridge/same_image.h"

namespace krot {

bool HasImageTwice(const Observation* observations, int count) {
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < i; ++j) {
      if (observations[i].view == observations[j].view) return true;
    }
  }
  return false;
}

std::vector<char> ClosestOfImages(const std::vector<ImageGeometry>& images,
                                  const Observation* observations, int count,
                                  const Eigen::Vector3d& xyz) {
  std::vector<double> errors;
  for (int i = 0; i < count; ++i) {
    const Observation& o = observations[i];
    const Eigen::Vector3d wv = o.E * (images[o.view].cam_from_world * xyz);
    errors.push_back(wv.tail<2>().norm() / wv[0]);
  }
  std::vector<char> is_closest(count, 1);
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < i; ++j) {
      if (observations[i].view != observations[j].view) continue;
      is_closest[errors[i] < errors[j] ? j : i] = 0;
    }
  }
  return is_closest;
}

// Observations stand in the order of their tracks, in front of positions' rows.
std::vector<Role> RolesOf(const Model& model, const BuiltProblem& built,
                          SameImage same_image) {
  const KnownRotationProblem& problem = built.problem;
  std::vector<Role> roles(model.track_elements.size(), Role::kOut);
  for (size_t k = 0; k < built.point_of.size(); ++k) {
    const int64_t begin = problem.point_begin[k];
    const int64_t end = problem.point_begin[k + 1];
    const auto is_of_image = [&](int64_t i, const TrackElement& element) {
      return built.HasPixel(i) &&
             model.images[built.image_of[problem.observations[i].view]].id ==
                 element.image_id;
    };
    int64_t next = begin;
    const Point3D& point = model.points3D[built.point_of[k]];
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const TrackElement& element = model.track_elements[e];
      if (next < end && is_of_image(next, element) &&
          static_cast<uint32_t>(built.point2D_of[next]) ==
              element.point2D_idx) {
        roles[e] = Role::kIn;
        ++next;
        continue;
      }
      if (same_image == SameImage::kKeep) continue;
      for (int64_t i = begin; i < end && roles[e] == Role::kOut; ++i) {
        if (is_of_image(i, element)) roles[e] = Role::kTwin;
      }
    }
  }
  return roles;
}

}  // namespace krot
