#include "krot/convert/reprojection.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <unordered_map>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/camera/camera_model.h"
#include "krot/camera/models.h"
#include "krot/camera/remainder_bound.h"
#include "krot/geometry.h"
#include "krot/minimax/residual_set.h"
#include "krot/model/rigs.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Of = KnownPosition::Of;

// The range of |U p|.
constexpr double kNearestApex = 1.5;
constexpr double kFarthestApex = 1e6;

const BuiltPosition& PositionOfRow(const BuiltProblem& built,
                                   int64_t observation) {
  return built.positions[PositionOf(built, observation)];
}

// U p of a row for a camera at the offset U (C - g) from the region's centre.
// Rows 0 and 1 are two perpendicular cones that touch the unit ball in the
// direction n of the offset, a'n = 1 / |U p|. Row 2 is a cone from the far
// side.
Vector3d ApexAround(const Vector3d& offset, int64_t row) {
  const double length = offset.norm();
  const Vector3d n =
      length > 1e-9 ? Vector3d(offset / length) : Vector3d::UnitX();
  // A distant apex makes the cone almost a tube about the region, and lies
  // beyond a camera that is far off; a near one keeps more digits.
  const double distance =
      std::min(std::max(10.0, 4 * length), kFarthestApex / 2);
  if (row == 2) return -distance * n;
  const Vector3d b = n.unitOrthogonal();
  const double sine = 1 / distance;
  return distance * (sine * n + std::sqrt(1 - sine * sine) *
                                    (row == 0 ? b : Vector3d(n.cross(b))));
}

Vector3d ApexOf(const BuiltProblem& built, int64_t observation,
                const Vector3d& offset) {
  const Matrix3d& unit_from_world =
      PositionOfRow(built, observation).unit_from_world;
  return unit_from_world.inverse() *
         ApexAround(unit_from_world * offset,
                    RowIndex(built, observation) % kRowsPerPosition);
}

// Calls visit(i) for every row of a known position, in order.
template <typename Visit>
void ForPositionRows(const BuiltProblem& built, const Visit& visit) {
  if (built.positions.empty()) return;
  const auto count = static_cast<int64_t>(built.problem.observations.size());
  for (int64_t i = 0; i < count; ++i) {
    if (!built.HasPixel(i)) visit(i);
  }
}

// Adds the views and observations of known positions; their rows are set
// afterwards.
class PositionAdder {
 public:
  explicit PositionAdder(BuiltProblem* built)
      : built_(*built), problem_(built->problem) {}

  // The position of a view's camera: views of its frame see a fixed point.
  void AddCamera(int32_t view, const Ellipsoid& region) {
    Add({Of::kImage, view, region, region.UnitFromWorld()},
        View(problem_.views[view]), problem_.num_points);
    problem_.fixed_points.resize(problem_.num_points);
    problem_.fixed_points.emplace_back(region.centre);
    built_.start.points.push_back(region.centre);
    ++problem_.num_points;
  }

  // The position of a point: a fixed frame at the world's origin sees it.
  void AddPoint(int32_t point, const Ellipsoid& region) {
    if (frame_ < 0) {
      frame_ = problem_.num_frames++;
      problem_.fixed_translations.resize(frame_);
      problem_.fixed_translations.emplace_back(Vector3d::Zero());
      built_.start.translations.emplace_back(Vector3d::Zero());
    }
    Add({Of::kPoint3D, point, region, region.UnitFromWorld()},
        {Matrix3d::Identity(), Matrix3d::Identity(), Vector3d::Zero(), frame_},
        point);
  }

  // Sorts observations by point again.
  void Sort() {
    if (frame_ < 0) return;
    auto order =
        NumbersUpTo<size_t>(static_cast<int64_t>(problem_.observations.size()));
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
      return problem_.observations[a].point < problem_.observations[b].point;
    });
    const auto sort = [&](auto* values) {
      auto sorted = *values;
      for (size_t n = 0; n < order.size(); ++n) sorted[n] = (*values)[order[n]];
      *values = std::move(sorted);
    };
    sort(&problem_.observations);
    sort(&built_.pixels);
    sort(&built_.point2D_of);
  }

 private:
  void Add(const BuiltPosition& position, const View& view, int32_t point) {
    built_.positions.push_back(position);
    for (int row = 0; row < kRowsPerPosition; ++row) {
      const auto shifted = static_cast<int32_t>(problem_.views.size());
      problem_.views.push_back(view);
      problem_.observations.push_back({Matrix3d::Identity(), shifted, point});
      built_.pixels.emplace_back(Eigen::Vector2d::Zero());
      built_.point2D_of.push_back(-1);
    }
  }

  BuiltProblem& built_;
  KnownRotationProblem& problem_;
  int32_t frame_ = -1;
};

// E of such a row for a camera with axes of that rotation. None if p cannot be
// used: it is not finite, or |U p| is out of range.
std::optional<Matrix3d> MakePositionRow(const Matrix3d& cam_from_world,
                                        const Matrix3d& unit_from_world,
                                        const Vector3d& apex, double level) {
  const Vector3d p = unit_from_world * apex;
  const double distance = p.norm();
  if (!(distance >= kNearestApex && distance <= kFarthestApex)) {
    return std::nullopt;
  }
  const double cotangent = std::sqrt((distance - 1) * (distance + 1));
  const Vector3d a = p / distance;
  const Vector3d m = a.unitOrthogonal();
  Matrix3d basis;
  basis << a.transpose(), m.transpose(), a.cross(m).transpose();
  basis.bottomRows<2>() *= level * cotangent / (1 + kPositionSlack);
  const Matrix3d E = basis * unit_from_world * cam_from_world.transpose();
  return E / E.row(0).norm();
}

}  // namespace

void AddPositions(const std::vector<KnownPosition>& positions,
                  BuiltProblem* built) {
  if (positions.empty()) return;
  const KnownRotationProblem& problem = built->problem;
  std::unordered_map<int32_t, const Ellipsoid*> of_image;
  std::unordered_map<int32_t, const Ellipsoid*> of_point;
  for (const KnownPosition& p : positions) {
    (p.of == Of::kImage ? of_image : of_point).emplace(p.index, &p.region);
  }
  PositionAdder adder(built);
  for (size_t v = 0; v < built->image_of.size(); ++v) {
    const auto known = of_image.find(built->image_of[v]);
    if (known == of_image.end() ||
        problem.IsFixedFrame(problem.views[v].frame)) {
      continue;
    }
    adder.AddCamera(static_cast<int32_t>(v), *known->second);
  }
  for (size_t k = 0; k < built->point_of.size(); ++k) {
    const auto known = of_point.find(built->point_of[k]);
    const auto point = static_cast<int32_t>(k);
    if (known == of_point.end() || problem.IsFixedPoint(point)) continue;
    adder.AddPoint(point, *known->second);
  }
  adder.Sort();
  TakePositionRowsOfStart(built->position_level, built);
}

uint64_t IdOf(const Model& model, const BuiltProblem& built,
              const BuiltPosition& position) {
  return position.of == Of::kImage
             ? model.images[built.image_of[position.index]].id
             : model.points3D[built.point_of[position.index]].id;
}

Vector3d OffsetOf(const BuiltProblem& built, const Estimate& estimate,
                  const BuiltPosition& position) {
  if (position.of == Of::kPoint3D) {
    return position.region.centre - estimate.points[position.index];
  }
  const View& view = built.problem.views[position.index];
  return Center(
             {view.cam_from_world_rotation,
              CamFromWorld(view, estimate.translations[view.frame]).col(3)}) -
         position.region.centre;
}

Vector3d ApexAt(const BuiltProblem& built, const Estimate& estimate,
                int64_t observation) {
  return ApexOf(built, observation,
                OffsetOf(built, estimate, PositionOfRow(built, observation)));
}

Vector3d ApexOfStart(const BuiltProblem& built, int64_t observation) {
  return ApexOf(built, observation, Vector3d::Zero());
}

bool PutPositionRow(const BuiltProblem& built, int64_t observation,
                    const Vector3d& apex, double level,
                    KnownRotationProblem* problem) {
  const BuiltPosition& position = PositionOfRow(built, observation);
  Observation& own = problem->observations[observation];
  View& view = problem->views[own.view];
  const auto row = MakePositionRow(view.cam_from_world_rotation,
                                   position.unit_from_world, apex, level);
  if (!row) return false;
  own.E = *row;
  view.cam_from_rig_translation =
      position.of == Of::kPoint3D
          ? Vector3d(apex - position.region.centre)
          : Vector3d(
                built.problem.views[position.index].cam_from_rig_translation +
                view.cam_from_world_rotation * apex);
  return true;
}

void TakePositionRowsOfStart(double level, BuiltProblem* built) {
  built->position_level = level;
  ForPositionRows(*built, [&](int64_t i) {
    PutPositionRow(*built, i, ApexOfStart(*built, i), level, &built->problem);
  });
}

void TakePositionRows(const BuiltProblem& built, const Estimate& estimate,
                      KnownRotationProblem* problem) {
  ForPositionRows(built, [&](int64_t i) {
    PutPositionRow(built, i, ApexAt(built, estimate, i), built.position_level,
                   problem);
  });
}

double LargestPositionRatio(const BuiltProblem& built,
                            const Estimate& estimate) {
  double largest = 0;
  for (const BuiltPosition& position : built.positions) {
    largest = std::max(largest, (position.unit_from_world *
                                 OffsetOf(built, estimate, position))
                                    .norm());
  }
  return largest;
}

bool LevelPositions(const BuiltProblem& built, Certificate* certificate) {
  const double shorter = built.position_level / certificate->lower_bound;
  for (CertifiedObservation& o : certificate->observations) {
    if (built.HasPixel(o.observation)) continue;
    if (shorter > 1) return false;
    o.y *= shorter;
  }
  return true;
}

Reprojection::Reprojection(const Model& model, const BuiltProblem& built)
    : built_(built), is_linear_(built.positions.empty()) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  for (const int32_t image : built.image_of) {
    const Camera& camera = model.cameras[geometries[image].camera];
    sources_.emplace_back(camera);
    is_linear_ = is_linear_ && camera.model_id <= Pinhole::kId;
  }
}

Eigen::Vector3d Reprojection::InCamera(const Estimate& estimate,
                                       int64_t i) const {
  const KnownRotationProblem& problem = built_.problem;
  const Observation& observation = problem.observations[i];
  const View& view = problem.views[observation.view];
  return internal::InCamera(
      CamFromWorld(view, estimate.translations[view.frame]),
      estimate.points[observation.point]);
}

double Reprojection::Error(const Estimate& estimate, Norm norm,
                           int64_t i) const {
  const Observation& o = built_.problem.observations[i];
  const Intrinsics& source = sources_[o.view];
  const Eigen::Vector3d x_cam = InCamera(estimate, i);
  const std::optional<Eigen::Vector2d> e =
      ProjectionError(source, built_.pixels[i], x_cam);
  if (!e) return kInfinity;
  // What a change in the coordinates' last digits does to the error, pixels.
  // Coordinates are computed in a few operations. It is negligible unless a
  // point all but coincides with its camera.
  const int32_t frame = built_.problem.views[o.view].frame;
  const double digits =
      4 * std::numeric_limits<double>::epsilon() *
      (estimate.points[o.point].lpNorm<Eigen::Infinity>() +
       estimate.translations[frame].lpNorm<Eigen::Infinity>());
  const double resolution =
      o.E.bottomRows<2>().norm() * digits / std::abs(o.E.row(0).dot(x_cam));
  const double error = NormOf(*e, norm) / built_.ScaleOf(i) + resolution;
  return std::isfinite(error) ? error : kInfinity;
}

double Reprojection::TrueCost(const Estimate& estimate, Norm norm,
                              int num_threads) const {
  const auto count = static_cast<int64_t>(built_.problem.observations.size());
  return ParallelMax(count, num_threads, [&](int64_t i) {
    return built_.HasPixel(i) ? Error(estimate, norm, i) : 0;
  });
}

double Reprojection::LevelledCost(const Estimate& estimate, Norm norm,
                                  int num_threads) const {
  return std::max(
      TrueCost(estimate, norm, num_threads),
      built_.position_level * LargestPositionRatio(built_, estimate));
}

bool Reprojection::TakeRows(const Estimate& estimate, int num_threads,
                            KnownRotationProblem* problem) const {
  if (is_linear_) return true;
  TakePositionRows(built_, estimate, problem);
  const std::vector<AffineMap> cameras =
      CamerasFromWorld(built_.problem, estimate.translations);
  const auto count = static_cast<int64_t>(problem->observations.size());
  std::atomic<bool> do_project{true};
  ParallelForEach(count, num_threads, [&](int64_t i) {
    if (!built_.HasPixel(i)) return;
    Observation& observation = problem->observations[i];
    const Intrinsics& source = sources_[observation.view];
    const auto row =
        RowAtProjection(source, built_.pixels[i],
                        internal::InCamera(cameras[observation.view],
                                           estimate.points[observation.point]));
    if (row) {
      observation.E = *row;
      if (!built_.scales.empty()) {
        observation.E.bottomRows<2>() /= built_.ScaleOf(i);
      }
    } else {
      do_project = false;
    }
  });
  return do_project;
}

namespace {

std::optional<Eigen::Matrix3d> OuterRow(const Intrinsics& source,
                                        const Eigen::Vector2d& pixel, Norm norm,
                                        double level) {
  const auto bearing = PixelBearing(source, pixel);
  if (!bearing) return std::nullopt;
  auto E = RowAtProjection(source, pixel, *bearing);
  const auto kappa = RemainderBound(source, pixel, *bearing, level, norm.p);
  if (!E || !kappa) return std::nullopt;
  const double terms =
      E->bottomRows<2>().cwiseAbs().sum() + pixel.lpNorm<1>() + level;
  // 1e-13 is above the relative rounding of the operations that make a row.
  E->bottomRows<2>() /= (1 + *kappa) * (1 + 1e-13 * terms / level);
  return E;
}

}  // namespace

std::vector<char> TakeOuterRows(const Model& model, const BuiltProblem& built,
                                Norm norm, double level, int num_threads,
                                KnownRotationProblem* problem) {
  const Reprojection reprojection(model, built);
  const auto count = static_cast<int64_t>(problem->observations.size());
  std::vector<char> has_row(count, 0);
  ParallelForEach(count, num_threads, [&](int64_t i) {
    const auto row =
        OuterRow(reprojection.SourceOf(i), built.pixels[i], norm, level);
    if (!row) return;
    problem->observations[i].E = *row;
    has_row[i] = 1;
  });
  return has_row;
}

}  // namespace krot::internal
