#pragma once

#include <cstdint>
#include <vector>

#include "krot/model.h"

namespace krot::internal {

struct RemovedObservations {
  Model model;
  std::vector<uint64_t> element_of;  // what each track element was
  // Elements that went because fewer than two of their track were left.
  int64_t num_left_alone = 0;
  int64_t num_points = 0;  // whose tracks went with them
};

// A copy of `model` without the track elements that `is_removed` marks, and
// without the points that keep fewer than two. 2D points that belong to no
// track any more name no 3D point; images and 2D points all stay, and so does
// every order. Requires a valid model; throws std::invalid_argument unless
// there is one mark per element.
RemovedObservations RemoveObservations(const Model& model,
                                       const std::vector<char>& is_removed);

// A copy without the images that `is_removed` marks, in the order of
// Model::images, as if they had not been registered: frames go with their last
// image, cameras and rigs stay. Tracks must not hold them any more; throws
// std::invalid_argument unless there is one mark per image.
Model RemoveImages(const Model& model, const std::vector<char>& is_removed);

}  // namespace krot::internal
