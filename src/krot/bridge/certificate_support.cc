#include "krot/bridge/certificate_support.h"

#include <algorithm>
#include <map>
#include <utility>

#include "krot/bridge/point_repair.h"
#include "krot/bridge/position_rows.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

bool HasImageTwice(const KnownRotationProblem& problem, int32_t point) {
  const int64_t begin = problem.point_begin[point];
  return HasImageTwice(
      &problem.observations[begin],
      static_cast<int>(problem.point_begin[point + 1] - begin));
}

// All but its share.
SupportPosition Describe(const Model& model, const BuiltProblem& built,
                         const Estimate& estimate,
                         const BuiltPosition& position) {
  SupportPosition described;
  if (position.of == KnownPosition::Of::kImage) {
    const Image& image = model.images[built.image_of[position.index]];
    described.image_id = image.id;
    described.image_name = image.name;
  } else {
    described.point3D_id = model.points3D[built.point_of[position.index]].id;
  }
  const Eigen::Vector3d offset = OffsetOf(built, estimate, position);
  const double ratio = (position.unit_from_world * offset).norm();
  described.distance = offset.norm();
  described.radius = ratio > 0 ? described.distance / ratio
                               : position.region.semi_axes.minCoeff();
  return described;
}

}  // namespace

std::vector<SupportPosition> ListSupportPositions(
    const Model& model, const BuiltProblem& built, const Estimate& estimate,
    const PixelCertificate& certificate) {
  // By index, the force of all its rows on the camera.
  std::map<int64_t, Eigen::Vector3d> pulls;
  const Certificate& rows = certificate.rows;
  KnownRotationProblem problem = built.problem;
  for (size_t n = 0; n < rows.observations.size(); ++n) {
    const CertifiedObservation& o = rows.observations[n];
    if (built.HasPixel(o.observation) ||
        !PutPositionRow(built, o.observation, certificate.bearings[n],
                        rows.lower_bound, &problem)) {
      continue;
    }
    const Observation& own = problem.observations[o.observation];
    pulls.emplace(PositionOf(built, o.observation), Eigen::Vector3d::Zero())
        .first->second +=
        own.E.transpose() *
        Eigen::Vector3d(rows.lower_bound * o.lambda, o.y[0], o.y[1]);
  }
  double sum = 0;
  for (const auto& [position, pull] : pulls) sum += pull.norm();
  std::vector<SupportPosition> support;
  for (const auto& [n, pull] : pulls) {
    SupportPosition position =
        Describe(model, built, estimate, built.positions[n]);
    position.share = pull.norm() / sum;
    support.push_back(std::move(position));
  }
  std::stable_sort(
      support.begin(), support.end(),
      [](const auto& a, const auto& b) { return a.share > b.share; });
  return support;
}

std::vector<SupportObservation> ListSupport(const Model& model,
                                            const BuiltProblem& built,
                                            const Estimate& estimate, Norm norm,
                                            const Certificate& certificate) {
  double sum = 0;
  for (const CertifiedObservation& o : certificate.observations) {
    sum += o.lambda;
  }
  std::vector<SupportObservation> support;
  for (const CertifiedObservation& o : certificate.observations) {
    if (!built.HasPixel(o.observation)) continue;
    const Observation& observation = built.problem.observations[o.observation];
    const Image& image = model.images[built.image_of[observation.view]];
    support.push_back(
        {image.id, image.name,
         static_cast<uint32_t>(built.point2D_of[o.observation]),
         model.points3D[built.point_of[observation.point]].id, o.lambda / sum,
         ResidualOf(ViewPoint(built.problem, observation, estimate), norm),
         HasImageTwice(built.problem, observation.point)});
  }
  std::stable_sort(
      support.begin(), support.end(),
      [](const auto& a, const auto& b) { return a.error_px > b.error_px; });
  return support;
}

}  // namespace krot::internal
