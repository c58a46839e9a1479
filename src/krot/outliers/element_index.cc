#include "krot/outliers/element_index.h"

namespace krot::internal {

// Both go along the tracks.
std::vector<uint64_t> ElementsOf(const Model& model,
                                 const BuiltProblem& built) {
  const KnownRotationProblem& problem = built.problem;
  std::vector<uint64_t> elements;
  elements.reserve(problem.observations.size());
  for (int32_t k = 0; k < problem.num_points; ++k) {
    uint64_t e = model.points3D[built.point_of[k]].track_begin;
    for (int64_t i = problem.point_begin[k]; i < problem.point_begin[k + 1];
         ++i, ++e) {
      const ImageId image =
          model.images[built.image_of[problem.observations[i].view]].id;
      while (model.track_elements[e].image_id != image ||
             model.track_elements[e].point2D_idx !=
                 static_cast<uint32_t>(built.point2D_of[i])) {
        ++e;
      }
      elements.push_back(e);
    }
  }
  return elements;
}

}  // namespace krot::internal
