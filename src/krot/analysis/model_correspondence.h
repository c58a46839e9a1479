#pragma once

#include <cstdint>
#include <vector>

#include "krot/model.h"

namespace krot::internal {

// What two models of the same images have in common.

struct IndexPair {
  int32_t first = 0;   // index in the first model's list
  int32_t second = 0;  // index in the second's
};

struct ElementPair {
  uint64_t first = 0;  // index in the first model's track_elements
  uint64_t second = 0;
};

struct ModelCorrespondence {
  // Images of the same name, whatever their ids, in the order of the first
  // model. Of images that share a name within one model the first counts.
  std::vector<IndexPair> images;
  // 2D points of these images that both models list under the same index, not
  // more than 0.01 px apart, and that belong to a 3D point in both; where
  // several tracks hold a 2D point, those of 3D points with the same id.
  std::vector<ElementPair> observations;
  // 3D points that share more of these observations with each other than
  // with any third point, whatever their ids; among equals the one with the
  // same id, else the one that comes first. In the order of the first model.
  std::vector<IndexPair> points;
};

// Requires valid models (ValidateModel).
// O(2D points + observations log observations).
ModelCorrespondence FindCorrespondence(const Model& model1,
                                       const Model& model2);

}  // namespace krot::internal
