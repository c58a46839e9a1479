#pragma once

#include <cstdint>
#include <vector>

#include "krot/check.h"
#include "krot/model.h"

namespace krot::internal {

// What no adjustment of a model mends.
struct LastingFaults {
  // Observations whose point lies in their camera (ObservationNoise::w).
  int64_t num_in_camera = 0;
  // Sets of frames that tracks join, and the images outside the largest one.
  // Frames without tracks are in none.
  int32_t num_parts = 0;
  int64_t num_images_outside = 0;
  int64_t num_images = 0;  // in all parts
};
// Requires a valid model. O(observations).
LastingFaults FindLastingFaults(const Model& model);

// The parts of a model that too few tracks tie to the rest, the most images
// first. Tracks are those that `noise` tests, as it fits them; sigma_px must be
// known. A maximum spanning tree joins frames by the tracks that they share.
// Where cutting it gives a part of two frames or more that is not tied by many
// tracks which several frames of both sides see, ModelPart::center_sigma is
// found for it.
//
// To first order: a part moves as a whole, with its points, by a similarity
// about its centre o, so by K (t, omega, s) at x with K = (I, -[x - o]x, x -
// o). Of a track with the information H_a of the part's observations about the
// point and H_b of the others', the point eliminated,
//
//   K' H_a (H_a + H_b)^-1 H_b K
//
// is what it says about the part, and sigma^2 times the inverse of their sum is
// the covariance. Requires a valid model. O(sum of squared track lengths), and
// O(observations) for each part that is not tied by many tracks.
std::vector<ModelPart> FindLooseParts(const Model& model,
                                      const ModelNoise& noise);

}  // namespace krot::internal
