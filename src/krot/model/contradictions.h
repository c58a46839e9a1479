#pragma once

#include <cstdint>
#include <string>

#include "krot/model/model.h"

namespace krot {

// A COLMAP model says twice which 2D points see a 3D point: in the tracks and
// in the images. Scripts write models where the two differ; COLMAP reads them
// and follows the tracks.

struct Contradictions {
  // Whose 2D point names another 3D point or none, does not exist, or is in
  // this track already.
  int64_t num_track_elements = 0;
  // That name a 3D point whose track does not name them, or that there is not.
  int64_t num_points2D = 0;
  std::string first;  // the first of them, as one sentence; "" if none

  bool Any() const { return num_track_elements > 0 || num_points2D > 0; }
};

// Requires consecutive tracks, as ReadModel leaves them.
// O(size of the model), a few ns per 2D point.
Contradictions FindContradictions(const Model& model);

// Makes the tracks say what the images say: elements that a 2D point does not
// confirm go, 2D points that no element named are appended in the order of
// the images; 2D points name none where their 3D point does not exist. A
// model without contradictions stays as it is. Requires consecutive tracks.
void FollowImages(Model* model);

// 2D points name none where their 3D point does not exist.
void DropUnknownPoints3D(Model* model);

}  // namespace krot
