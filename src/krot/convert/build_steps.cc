#include "krot/convert/build_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <Eigen/Eigenvalues>

#include "krot/base/check.h"
#include "krot/camera/camera_model.h"
#include "krot/minimax/residual_set.h"
#include "krot/model/rigs.h"

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

namespace {

using Eigen::Vector3d;

// Stored poses that differ from those of frames and rigs by less than this
// differ by rounding alone; quaternions, and translations relative to their
// size.
constexpr double kSamePose = 1e-9;

bool IsSamePoint(const Vector3d& a, const Vector3d& b) {
  return (a - b).norm() <= kSamePose * a.norm();
}

// Makes the image agree with its frame, whose translation was `geometry`'s
// and is now `translation`.
void FollowFrame(const ImageGeometry& geometry, const Vector3d& translation,
                 Pose* cam_from_world) {
  const bool has_same_rotation =
      (cam_from_world->Rotation() - geometry.cam_from_world.rotation).norm() <=
      kSamePose;
  if (!has_same_rotation) {
    cam_from_world->quaternion_wxyz =
        ToWxyz(Eigen::Quaterniond(geometry.cam_from_world.rotation));
  }
  const bool frame_stays = translation == geometry.rig_from_world.translation;
  if (frame_stays && IsSamePoint(geometry.cam_from_world.translation,
                                 cam_from_world->translation)) {
    return;
  }
  cam_from_world->translation = geometry.cam_from_rig * translation;
}

}  // namespace

Estimate OwnEstimate(const Model& model, const BuiltProblem& built) {
  Estimate estimate;
  for (const int32_t frame : built.frame_of) {
    estimate.translations.push_back(
        model.frames[frame].rig_from_world.translation);
  }
  for (const int32_t point : built.point_of) {
    estimate.points.push_back(model.points3D[point].xyz);
  }
  // Known positions add frames and points behind the model's; these do not
  // move.
  const Estimate& start = built.start;
  estimate.translations.insert(
      estimate.translations.end(),
      start.translations.begin() +
          static_cast<std::ptrdiff_t>(built.frame_of.size()),
      start.translations.end());
  estimate.points.insert(
      estimate.points.end(),
      start.points.begin() + static_cast<std::ptrdiff_t>(built.point_of.size()),
      start.points.end());
  return estimate;
}

Model ApplyEstimate(const Model& model, const BuiltProblem& built,
                    const Estimate& estimate) {
  CheckArgument(estimate.translations.size() == built.start.translations.size(),
                "estimate.translations.size()", estimate.translations.size(),
                "the number of frames");
  CheckArgument(estimate.points.size() == built.start.points.size(),
                "estimate.points.size()", estimate.points.size(),
                "the number of points");

  Model result = model;
  for (size_t k = 0; k < built.point_of.size(); ++k) {
    result.points3D[built.point_of[k]].xyz = estimate.points[k];
  }
  for (size_t f = 0; f < built.frame_of.size(); ++f) {
    result.frames[built.frame_of[f]].rig_from_world.translation =
        estimate.translations[f];
  }
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  for (size_t j = 0; j < built.image_of.size(); ++j) {
    const int32_t image = built.image_of[j];
    FollowFrame(geometries[image],
                estimate.translations[built.problem.views[j].frame],
                &result.images[image].cam_from_world);
  }
  return result;
}

namespace {

// The largest error of a point's observations, only over those whose error was
// finite before; infinite if one of these no longer projects.
class TrackError {
 public:
  TrackError(const Model& model, const std::vector<double>& errors_before_px,
             Norm norm)
      : model_(model),
        errors_before_px_(errors_before_px),
        norm_(norm),
        images_(ImageGeometries(model)),
        image_of_(ImagesOfElements(model)) {}

  double operator()(const Point3D& point, const Vector3d& xyz) const {
    double largest = 0;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!std::isfinite(errors_before_px_[e])) continue;
      const int32_t n = image_of_[e];
      const Point2D& point2D =
          model_.images[n].points2D[model_.track_elements[e].point2D_idx];
      const Camera& camera = model_.cameras[images_[n].camera];
      const auto error = ProjectionError(camera, {point2D.x, point2D.y},
                                         images_[n].cam_from_world * xyz);
      if (!error) return std::numeric_limits<double>::infinity();
      largest = std::max(largest, NormOf(*error, norm_));
    }
    return largest;
  }

  Vector3d CentreOf(uint64_t e) const {  // of the element's camera
    return Center(images_[image_of_[e]].cam_from_world);
  }

 private:
  const Model& model_;
  const std::vector<double>& errors_before_px_;
  const Norm norm_;
  const std::vector<ImageGeometry> images_;
  const std::vector<int32_t> image_of_;  // each track element's
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
      const Vector3d xyz =
          start + (error_after.CentreOf(e) - error_before.CentreOf(e));
      const double error = error_after(point, xyz);
      if (!(error < lowest)) continue;
      lowest = error;
      point.xyz = xyz;
    }
  }
}

}  // namespace krot::internal
