#include "krot/bridge/certificate_support.h"

#include <algorithm>

#include "krot/bridge/same_image.h"
#include "krot/problem/cost.h"

namespace krot {
namespace {

bool HasImageTwice(const KnownRotationProblem& problem, int32_t point) {
  const int64_t begin = problem.point_begin[point];
  return HasImageTwice(
      &problem.observations[begin],
      static_cast<int>(problem.point_begin[point + 1] - begin));
}

}  // namespace

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

}  // namespace krot
