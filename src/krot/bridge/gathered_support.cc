#include "krot/bridge/gathered_support.h"

#include <algorithm>

#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

// What is not in a problem of an observation.
struct Sighting {
  Eigen::Vector2d pixel;
  int32_t point2D;
};

// Cameras and poses.
Model WithoutPoints(const Model& model) {
  Model result;
  result.stores_rigs = model.stores_rigs;
  result.cameras = model.cameras;
  result.rigs = model.rigs;
  result.frames = model.frames;
  for (const Image& image : model.images) {
    result.images.push_back(
        {image.id, image.cam_from_world, image.camera_id, image.name, {}});
  }
  return result;
}

}  // namespace

int64_t GatheredSupport::Find(int64_t number) const {
  return std::lower_bound(in_whole.begin(), in_whole.end(), number) -
         in_whole.begin();
}

Certificate GatheredSupport::FromWhole(Certificate certificate) const {
  for (CertifiedObservation& o : certificate.observations) {
    o.observation = Find(o.observation);
  }
  return certificate;
}

Certificate GatheredSupport::ToWhole(Certificate certificate) const {
  for (CertifiedObservation& o : certificate.observations) {
    o.observation = in_whole[o.observation];
  }
  return certificate;
}

GatheredSupport GatherSupport(const Model& model, const BuiltProblem& built,
                              const Estimate& estimate,
                              const std::vector<int64_t>& observations,
                              Ranks* ranks) {
  std::vector<int32_t> points;
  for (const int64_t i : observations) {
    const int32_t k = built.problem.observations[i].point;
    if (points.empty() || points.back() != k) points.push_back(k);
  }
  std::vector<Point3DId> ids;
  std::vector<Sighting> sightings;
  std::vector<int64_t> of_points;
  for (const int32_t k : points) {
    ids.push_back(model.points3D[built.point_of[k]].id);
    for (int64_t i = built.problem.point_begin[k];
         i < built.problem.point_begin[k + 1]; ++i) {
      sightings.push_back({built.pixels[i], built.point2D_of[i]});
      of_points.push_back(i);
    }
  }
  const GatheredPart part(built.problem, of_points, ranks);
  GatheredSupport support;
  support.model = WithoutPoints(model);
  support.built.problem = part.problem();
  support.built.frame_of = built.frame_of;
  support.built.image_of = built.image_of;
  support.estimate = part.Collect(estimate);
  support.in_whole = part.in_whole();
  for (const Point3DId id : ranks->GatherOnFirst(ids)) {
    support.built.point_of.push_back(
        static_cast<int32_t>(support.model.points3D.size()));
    support.model.points3D.emplace_back().id = id;
  }
  for (const Sighting& sighting : ranks->GatherOnFirst(sightings)) {
    support.built.pixels.push_back(sighting.pixel);
    support.built.point2D_of.push_back(sighting.point2D);
  }
  const int64_t first =
      ranks->SumBefore(static_cast<int64_t>(built.problem.observations.size()));
  std::vector<int64_t> numbers;
  for (const int64_t i : observations) numbers.push_back(first + i);
  for (const int64_t number : ranks->GatherOnFirst(numbers)) {
    support.observations.push_back(support.Find(number));
  }
  return support;
}

std::vector<int64_t> OwnSupport(const Certificate& certificate,
                                int64_t num_observations, Ranks* ranks) {
  std::vector<int64_t> numbers;
  for (const CertifiedObservation& o : certificate.observations) {
    numbers.push_back(o.observation);
  }
  ranks->Broadcast(&numbers);
  const int64_t first = ranks->SumBefore(num_observations);
  std::vector<int64_t> own;
  for (const int64_t number : numbers) {
    if (number >= first && number < first + num_observations) {
      own.push_back(number - first);
    }
  }
  return own;
}

}  // namespace krot::internal
