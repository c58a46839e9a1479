#pragma once

#include <cstdint>
#include <vector>

#include "krot/model.h"
#include "krot/synthetic/random.h"
#include "krot/synthetic/scene.h"
#include "krot/synthetic/structure.h"

namespace krot::internal {

// How far inside the image exact projections should lie, in pixels, so that
// noise rarely has to be cut at the border.
double ObservationMargin(const SceneOptions& options);

// Adds the structure to `model`, whose images stand in the order of
// Sighting::image: 2D points with noise, outliers and twins; 3D points
// (without coordinates) and their tracks. Returns the indices of the outliers
// in Model::track_elements, ascending. O(sightings).
std::vector<int64_t> WriteObservations(const Structure& structure,
                                       const SceneOptions& options,
                                       Random* random, Model* model);

}  // namespace krot::internal
