#include "krot/bridge/position_rows.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include <Eigen/Geometry>

#include "krot/geometry/rigid_transform.h"
#include "krot/problem/cameras.h"

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// |p| in radii: far enough for a cone that is almost a tube about the ball, and
// beyond a camera that is far off; near enough to keep the digits.
constexpr double kApexDistance = 10;
constexpr double kApexPerOffset = 4;
constexpr double kNearestApex = 1.5;
constexpr double kFarthestApex = 1e6;
// Offsets below this, in radii, have no direction.
constexpr double kNoOffset = 1e-9;

const BuiltPosition& PositionOfRow(const BuiltProblem& built,
                                   int64_t observation) {
  return built.positions[PositionOf(built, observation)];
}

int64_t RowOfPosition(const BuiltProblem& built, int64_t observation) {
  return (observation - static_cast<int64_t>(built.pixels.size())) %
         kRowsPerPosition;
}

// Two cones that touch the ball in the offset's direction n, a'n = r / |p|,
// across each other, and one from the far side.
Vector3d ApexAround(const Vector3d& offset, double radius, int64_t row) {
  const double length = offset.norm();
  const Vector3d n = length > kNoOffset * radius ? Vector3d(offset / length)
                                                 : Vector3d::UnitX();
  const double distance =
      std::min(std::max(kApexDistance * radius, kApexPerOffset * length),
               kFarthestApex / 2 * radius);
  if (row == 2) return -distance * n;
  const Vector3d b = n.unitOrthogonal();
  const double sine = radius / distance;
  return distance * (sine * n + std::sqrt(1 - sine * sine) *
                                    (row == 0 ? b : Vector3d(n.cross(b))));
}

}  // namespace

std::optional<PositionRow> MakePositionRow(const Matrix3d& cam_from_world,
                                           double radius, const Vector3d& apex,
                                           double level) {
  const double distance = apex.norm();
  if (!(distance >= kNearestApex * radius &&
        distance <= kFarthestApex * radius)) {
    return std::nullopt;
  }
  const double cotangent =
      std::sqrt((distance - radius) * (distance + radius)) / radius;
  const Vector3d a = apex / distance;
  const Vector3d m = a.unitOrthogonal();
  Matrix3d basis;
  basis << a.transpose(), m.transpose(), a.cross(m).transpose();
  basis.bottomRows<2>() *= level * cotangent / (1 + kPositionSlack);
  return PositionRow{basis * cam_from_world.transpose(), cam_from_world * apex};
}

void AddPositions(const std::vector<KnownPosition>& positions,
                  BuiltProblem* built) {
  KnownRotationProblem& problem = built->problem;
  std::unordered_map<int32_t, const KnownPosition*> of_image;
  for (const KnownPosition& p : positions) of_image.emplace(p.image, &p);
  for (size_t v = 0; v < built->image_of.size(); ++v) {
    const auto known = of_image.find(built->image_of[v]);
    const auto view = static_cast<int32_t>(v);
    if (known == of_image.end() ||
        problem.IsFixedFrame(problem.views[view].frame)) {
      continue;
    }
    const auto& [image, xyz, radius] = *known->second;
    built->positions.push_back({view, xyz, radius});
    problem.fixed_points.resize(problem.num_points);
    problem.fixed_points.emplace_back(xyz);
    built->start.points.push_back(xyz);
    for (int row = 0; row < kRowsPerPosition; ++row) {
      const auto shifted = static_cast<int32_t>(problem.views.size());
      problem.views.push_back(View(problem.views[view]));
      problem.observations.push_back(
          {Matrix3d::Identity(), shifted, problem.num_points});
      const auto i = static_cast<int64_t>(problem.observations.size()) - 1;
      PutPositionRow(*built, i, ApexOfStart(*built, i), built->position_level,
                     &problem);
    }
    ++problem.num_points;
  }
}

Vector3d OffsetOf(const BuiltProblem& built, const Estimate& estimate,
                  const BuiltPosition& position) {
  const View& view = built.problem.views[position.view];
  return Center(
             {view.cam_from_world_rotation,
              CamFromWorld(view, estimate.translations[view.frame]).col(3)}) -
         position.xyz;
}

Vector3d ApexAt(const BuiltProblem& built, const Estimate& estimate,
                int64_t observation) {
  const BuiltPosition& position = PositionOfRow(built, observation);
  return ApexAround(OffsetOf(built, estimate, position), position.radius,
                    RowOfPosition(built, observation));
}

Vector3d ApexOfStart(const BuiltProblem& built, int64_t observation) {
  return ApexAround(Vector3d::Zero(), PositionOfRow(built, observation).radius,
                    RowOfPosition(built, observation));
}

bool PutPositionRow(const BuiltProblem& built, int64_t observation,
                    const Vector3d& apex, double level,
                    KnownRotationProblem* problem) {
  const BuiltPosition& position = PositionOfRow(built, observation);
  const View& view = built.problem.views[position.view];
  const auto row = MakePositionRow(view.cam_from_world_rotation,
                                   position.radius, apex, level);
  if (!row) return false;
  Observation& own = problem->observations[observation];
  own.E = row->E;
  problem->views[own.view].cam_from_rig_translation =
      view.cam_from_rig_translation + row->shift;
  return true;
}

void TakePositionRowsOfStart(double level, BuiltProblem* built) {
  built->position_level = level;
  const auto count = static_cast<int64_t>(built->problem.observations.size());
  for (auto i = static_cast<int64_t>(built->pixels.size()); i < count; ++i) {
    PutPositionRow(*built, i, ApexOfStart(*built, i), level, &built->problem);
  }
}

void TakePositionRows(const BuiltProblem& built, const Estimate& estimate,
                      KnownRotationProblem* problem) {
  const auto count = static_cast<int64_t>(problem->observations.size());
  for (auto i = static_cast<int64_t>(built.pixels.size()); i < count; ++i) {
    PutPositionRow(built, i, ApexAt(built, estimate, i), built.position_level,
                   problem);
  }
}

double LargestPositionRatio(const BuiltProblem& built,
                            const Estimate& estimate) {
  double largest = 0;
  for (const BuiltPosition& position : built.positions) {
    largest = std::max(
        largest, OffsetOf(built, estimate, position).norm() / position.radius);
  }
  return largest;
}

void LevelPositions(const BuiltProblem& built, Certificate* certificate) {
  for (CertifiedObservation& o : certificate->observations) {
    if (built.HasPixel(o.observation)) continue;
    o.y *= built.position_level / certificate->lower_bound;
  }
}

}  // namespace krot
