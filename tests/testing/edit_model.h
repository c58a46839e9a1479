#pragma once

#include <cstdint>
#include <vector>

#include "krot/model.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"

// Changes of models for tests.

namespace krot::internal {

// The 2D point of an observation.
inline Point2D& PixelOf(Model* model, uint64_t e) {
  const TrackElement& element = model->track_elements[e];
  return model->images[ImageIndices(*model).at(element.image_id)]
      .points2D[element.point2D_idx];
}

// Without the observations `e` for which is_removed(e) is true; that is called
// in their order.
template <typename Predicate>
Model Without(const Model& model, const Predicate& is_removed) {
  std::vector<char> removed;
  for (uint64_t e = 0; e < model.track_elements.size(); ++e) {
    removed.push_back(is_removed(e) ? 1 : 0);
  }
  return RemoveObservations(model, removed).model;
}

// An image keeps its first observations; its tracks keep their other ones.
inline Model WithFewObservationsOf(size_t image, int num_kept,
                                   const Model& model) {
  int num = 0;
  return Without(model, [&](uint64_t e) {
    return model.track_elements[e].image_id == model.images[image].id &&
           ++num > num_kept;
  });
}

}  // namespace krot::internal
