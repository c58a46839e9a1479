#include "krot/outliers/outlier_filter.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/convert/reprojection.h"
#include "krot/minimax/residual_set.h"
#include "krot/outliers/parts.h"
#include "krot/outliers/removal.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;

// An observation of the image, and its point in the camera as that stands now.
struct Sighting {
  Vector2d pixel;
  Vector3d x_cam;
};

// x_cam -> rotation * x_cam + translation.
struct Turn {
  Matrix3d rotation = Matrix3d::Identity();
  Vector3d translation = Vector3d::Zero();
};

class TurnFit {
 public:
  TurnFit(const Intrinsics& source, const ErrorBound& bound,
          std::vector<Sighting> sightings)
      : source_(source), bound_(bound), sightings_(std::move(sightings)) {}

  // Fits the translation and, if asked to, the rotation.
  Turn Fit(bool with_rotation) const {
    Turn turn;
    for (int n = 0; n < 50; ++n) {
      const Vector6d step = Step(turn, with_rotation);
      if (!step.allFinite()) break;
      const Vector3d omega = step.head<3>();
      const double angle = omega.norm();
      if (angle > 0) {
        turn.rotation =
            Eigen::AngleAxisd(angle, omega / angle).toRotationMatrix() *
            turn.rotation;
      }
      turn.translation += step.tail<3>();
      if (with_rotation && angle < 1e-12) break;
    }
    return turn;
  }

  int64_t NumAbove(const Turn& turn) const {
    return std::count_if(
        sightings_.begin(), sightings_.end(), [&](const Sighting& sighting) {
          const std::optional<Vector2d> e = ProjectionError(
              source_, sighting.pixel,
              turn.rotation * sighting.x_cam + turn.translation);
          return !e || !(NormOf(*e, bound_.norm) <= bound_.max_error);
        });
  }

 private:
  // A Gauss-Newton step, with rows taken at the projection: e = v / w.
  Vector6d Step(const Turn& turn, bool with_rotation) const {
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Vector6d gradient = Vector6d::Zero();
    for (const Sighting& sighting : sightings_) {
      const Vector3d turned = turn.rotation * sighting.x_cam;
      const Vector3d x = turned + turn.translation;
      const std::optional<Matrix3d> row =
          RowAtProjection(source_, sighting.pixel, x);
      if (!row) continue;
      const Vector3d wv = *row * x;
      const Vector2d e = wv.tail<2>() / wv[0];
      const Eigen::Matrix<double, 2, 3> by_x =
          (row->bottomRows<2>() - e * row->row(0)) / wv[0];
      Eigen::Matrix<double, 2, 6> J;
      J.rightCols<3>() = by_x;
      J.leftCols<3>().setZero();
      if (with_rotation) {
        for (int k = 0; k < 3; ++k) {
          J.col(k) = by_x * Vector3d::Unit(k).cross(turned);
        }
      }
      const double weight =
          1 / (1 + e.squaredNorm() / (bound_.max_error * bound_.max_error));
      normal += weight * J.transpose() * J;
      gradient += weight * J.transpose() * e;
    }
    for (int k = 0; k < 6; ++k) {
      normal(k, k) = normal(k, k) > 0 ? normal(k, k) * (1 + 1e-9) : 1;
    }
    return -normal.ldlt().solve(gradient);
  }

  const Intrinsics source_;
  const ErrorBound bound_;
  const std::vector<Sighting> sightings_;
};

// For each view the number of conflicts that it has observations in.
std::vector<int64_t> ConflictsOfViews(const KnownRotationProblem& problem,
                                      const std::vector<Conflict>& conflicts) {
  std::vector<int64_t> counts(problem.views.size(), 0);
  for (const Conflict& conflict : conflicts) {
    std::vector<int32_t> views;
    for (const int64_t i : conflict.observations) {
      views.push_back(problem.observations[i].view);
    }
    SortUnique(&views);
    for (const int32_t v : views) ++counts[v];
  }
  return counts;
}

// Of the views in most conflicts the one with most observations removed. (A
// conflict of two images accuses both alike.)
std::optional<int32_t> SuspectedView(const KnownRotationProblem& problem,
                                     const std::vector<int64_t>& counts,
                                     size_t num_conflicts,
                                     const Removal& removal) {
  std::vector<int64_t> num_removed(problem.views.size(), 0);
  for (const int64_t i : removal.observations) {
    ++num_removed[problem.observations[i].view];
  }
  std::optional<int32_t> suspected;
  for (size_t v = 0; v < counts.size(); ++v) {
    const bool is_in_most =
        counts[v] >= 3 && 2 * counts[v] >= static_cast<int64_t>(num_conflicts);
    if (!is_in_most) continue;
    if (!suspected || num_removed[v] > num_removed[*suspected]) {
      suspected = static_cast<int32_t>(v);
    }
  }
  return suspected;
}

std::vector<int64_t> ObservationsOf(const KnownRotationProblem& problem,
                                    int32_t view) {
  std::vector<int64_t> observations;
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    if (problem.observations[i].view == view) {
      observations.push_back(static_cast<int64_t>(i));
    }
  }
  return observations;
}

// The view's observations of points that have two observations in other views.
std::vector<Sighting> SightingsOf(const BuiltProblem& built,
                                  const Reprojection& reprojection,
                                  const std::vector<int64_t>& observations,
                                  const Estimate& estimate) {
  const KnownRotationProblem& problem = built.problem;
  std::vector<Sighting> sightings;
  for (const int64_t i : observations) {
    const int32_t k = problem.observations[i].point;
    int64_t num_others = 0;
    for (const int64_t j : problem.OfPoint(k)) {
      num_others +=
          problem.observations[j].view != problem.observations[i].view;
    }
    if (num_others < 2) continue;
    sightings.push_back({built.pixels[i], reprojection.InCamera(estimate, i)});
  }
  return sightings;
}

}  // namespace

std::optional<RotationSuspect> FindRotationSuspect(
    const Model& model, const BuiltProblem& built, const ErrorBound& bound,
    const std::vector<Conflict>& conflicts, const Removal& removal,
    const Context& context) {
  const std::vector<int64_t> counts =
      ConflictsOfViews(built.problem, conflicts);
  const std::optional<int32_t> view =
      SuspectedView(built.problem, counts, conflicts.size(), removal);
  if (!view) return std::nullopt;
  const std::vector<int64_t> observations =
      ObservationsOf(built.problem, *view);
  std::vector<int64_t> observations_and_removed;
  std::set_union(observations.begin(), observations.end(),
                 removal.observations.begin(), removal.observations.end(),
                 std::back_inserter(observations_and_removed));
  const Context within = context.Within("asking whether a rotation is wrong");
  const auto solve = [&](const std::vector<int64_t>& removed,
                         const Estimate& start) {
    return SolveWithout(model, built, removed, start, bound.norm, within);
  };
  const OptimumWithout with = solve({}, built.start);
  const OptimumWithout without = solve(observations, built.start);
  const OptimumWithout placed =
      solve(observations_and_removed, removal.estimate);
  const Reprojection reprojection(model, built);
  std::vector<Sighting> sightings =
      SightingsOf(built, reprojection, observations, placed.estimate);
  if (context.IsCancelled() || sightings.size() < 6) {
    return std::nullopt;
  }
  RotationSuspect suspect;
  const Image& image = model.images[built.image_of[*view]];
  suspect.image_id = image.id;
  suspect.image_name = image.name;
  suspect.num_conflicts = counts[*view];
  suspect.lower_bound_with = with.lower_bound;
  suspect.max_error_without = without.max_error;
  suspect.num_observations = static_cast<int64_t>(sightings.size());
  const TurnFit fit(reprojection.SourceOf(observations[0]), bound,
                    std::move(sightings));
  const Turn turn = fit.Fit(/*with_rotation=*/true);
  suspect.num_above = fit.NumAbove(fit.Fit(/*with_rotation=*/false));
  suspect.num_above_turned = fit.NumAbove(turn);
  const Eigen::AngleAxisd angle_axis(turn.rotation);
  suspect.angle_deg = angle_axis.angle() * kDegreesPerRadian;
  suspect.axis_in_cam = angle_axis.axis();
  return suspect;
}

}  // namespace krot::internal
