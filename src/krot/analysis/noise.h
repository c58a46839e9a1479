#pragma once

#include <cstdint>
#include <vector>

#include "krot/check.h"

namespace krot::internal {

// An observation that is no noise.
struct SnoopedObservation {
  uint64_t element = 0;  // in Model::track_elements
  // As it was removed, of two the larger one; infinite: not in front.
  double w = 0;
  // Where the rest of its track leads to, pixels; where nothing is left, where
  // its last two did. NaN if that is not in front of its camera.
  double error_px = 0;
  // One of two that contradict each other: which is wrong cannot be told.
  bool is_of_two = false;
};

struct NoiseSnooping {
  ModelNoise noise;                         // of what is left
  std::vector<SnoopedObservation> removed;  // largest w first
  std::vector<double> sigma_path_px;        // before each removal, and at last
  // Whether sigma stayed as it was at first: taken anew it fell until more than
  // half of the observations were gone, as it does where their noise has no
  // sigma in common.
  bool is_sigma_kept = false;
};

// Of every track the observation with the largest w is removed, if that is
// above the critical value, and the track is fitted anew; then sigma and the
// critical value are taken anew, until nothing is above. The largest w is the
// removal that lowers the track's sum of squares most, so that a wrong
// observation goes before the sound ones that it bends. Of a track of two both
// go. Requires and throws as above.
NoiseSnooping SnoopNoise(const Model& model, const NoiseOptions& options,
                         const Context& context);

}  // namespace krot::internal
