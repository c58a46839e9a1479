#pragma once

#include "krot/database.h"
#include "krot/model.h"

namespace krot::internal {

// The database that a model was made from, if all of its tracks are matches:
// the 2D points are its keypoints, of scale 1, and two images have a match for
// each two 2D points that see the same point. Requires a valid model. O(sum of
// squared track lengths).
Database DatabaseOf(const Model& model);

}  // namespace krot::internal
