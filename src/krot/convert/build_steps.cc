#include "krot/convert/build_problem.h"

#include <algorithm>
#include <optional>
#include <vector>

#include <Eigen/Eigenvalues>

namespace krot::internal {

void AddFramesAndViews(const Model& model,
                       const std::vector<ImageGeometry>& geometries,
                       Ranks* ranks, BuiltProblem* built) {
  KnownRotationProblem& problem = built->problem;
  std::vector<int32_t> frame_index(model.frames.size(), -1);
  for (const Observation& observation : problem.observations) {
    frame_index[geometries[observation.view].frame] = 0;
  }
  if (ranks != nullptr) {
    ranks->Reduce([](int32_t a, int32_t b) { return std::max(a, b); },
                  &frame_index);
  }
  for (const int32_t f : OrderOfIds(model.frames)) {
    if (frame_index[f] < 0) continue;
    frame_index[f] = problem.num_frames++;
    built->frame_of.push_back(f);
  }
  built->start.translations.resize(problem.num_frames);

  std::vector<int32_t> view_index(geometries.size(), -1);
  for (const int32_t n : OrderOfIds(model.images)) {
    const ImageGeometry& image = geometries[n];
    if (!image.has_pose || frame_index[image.frame] < 0) continue;
    view_index[n] = static_cast<int32_t>(problem.views.size());
    built->image_of.push_back(n);
    const int32_t frame = frame_index[image.frame];
    problem.views.push_back({image.cam_from_world.rotation,
                             image.cam_from_rig.rotation,
                             image.cam_from_rig.translation, frame});
    built->start.translations[frame] = image.rig_from_world.translation;
  }
  for (Observation& observation : problem.observations) {
    observation.view = view_index[observation.view];
  }
}

void FixPositions(const FixedParts& fixed, BuiltProblem* built) {
  KnownRotationProblem& problem = built->problem;
  const auto fix = [](const std::vector<char>& marks,
                      const std::vector<int32_t>& index_of,
                      const std::vector<Eigen::Vector3d>& start,
                      std::vector<std::optional<Eigen::Vector3d>>* positions) {
    if (marks.empty()) return;
    positions->resize(index_of.size());
    for (size_t n = 0; n < index_of.size(); ++n) {
      if (marks[index_of[n]]) (*positions)[n] = start[n];
    }
  };
  fix(fixed.frames, built->frame_of, built->start.translations,
      &problem.fixed_translations);
  fix(fixed.points3D, built->point_of, built->start.points,
      &problem.fixed_points);
}

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

// Relies on the order: observations are in the order of their tracks, in front
// of the rows of positions.
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

using Eigen::Matrix3d;
using Eigen::Vector3d;

std::optional<Vector3d> RetriangulateMidpoint(const std::vector<Ray>& rays) {
  if (rays.empty()) return std::nullopt;
  // Computed relative to the mean centre, where rounding is smallest.
  Vector3d mean_centre = Vector3d::Zero();
  for (const Ray& ray : rays) mean_centre += ray.centre;
  mean_centre /= static_cast<double>(rays.size());

  Matrix3d normal_matrix = Matrix3d::Zero();
  Vector3d right_hand_side = Vector3d::Zero();
  for (const Ray& ray : rays) {
    const Matrix3d across =
        Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    normal_matrix += across;
    right_hand_side += across * (ray.centre - mean_centre);
  }
  const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(normal_matrix);
  const Vector3d& eigenvalues = solver.eigenvalues();
  // The smallest eigenvalue of mean(I - d d') is about half the mean squared
  // sine between the rays and their mean direction. Below 1e-12 (angles of
  // 1e-6) it is within the rounding of rotations.
  if (!(eigenvalues[0] > 1e-12 * static_cast<double>(rays.size()))) {
    return std::nullopt;
  }
  const Matrix3d& axes = solver.eigenvectors();
  return mean_centre +
         axes * (axes.transpose() * right_hand_side).cwiseQuotient(eigenvalues);
}

namespace {

// The ray of an observation: from C = -R' t in the direction where v = 0 and w
// > 0.
Ray RayOf(const ImageGeometry& image, const Observation& observation) {
  const RigidTransform world_from_cam = Inverse(image.cam_from_world);
  Vector3d ray = observation.E.row(1).cross(observation.E.row(2));
  if (observation.E.row(0).dot(ray) < 0) ray = -ray;
  return {world_from_cam.translation,
          world_from_cam.rotation * ray.normalized()};
}

}  // namespace

RepairedPoint RepairPoint(
    const std::vector<ImageGeometry>& images, const Observation* observations,
    int count, const Vector3d& xyz,
    const std::function<bool(int, const Vector3d&)>& is_seen) {
  const auto count_unseen = [&](const Vector3d& point) {
    int num_unseen = 0;
    for (int i = 0; i < count; ++i) num_unseen += !is_seen(i, point);
    return num_unseen;
  };
  const RepairedPoint as_stored{xyz, /*is_retriangulated=*/false};
  const int num_unseen = count_unseen(xyz);
  if (num_unseen == 0) return as_stored;

  std::vector<Ray> rays;
  for (int i = 0; i < count; ++i) {
    rays.push_back(RayOf(images[observations[i].view], observations[i]));
  }
  const std::optional<Vector3d> midpoint = RetriangulateMidpoint(rays);
  if (!midpoint || count_unseen(*midpoint) >= num_unseen) return as_stored;
  return {*midpoint, /*is_retriangulated=*/true};
}

}  // namespace krot::internal
