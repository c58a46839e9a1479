#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/model.h"

namespace krot::internal {

// Degenerate geometry of an estimated model, which fits observations for no
// good reason: a point in a camera's centre lies on all of its rays, parallel
// rays meet at infinity, and where all points are one all cameras see the same.
// Errors do not show this; they may even fall to zero by it.
struct Collapse {
  int64_t num_points = 0;  // that two cameras see
  // Ids of points whose nearest camera has come closer than a millionth of the
  // median distance of the cameras that see them.
  std::vector<Point3DId> in_camera;
  // Ids of points whose rays have come within a millionth of a radian of each
  // other.
  std::vector<Point3DId> at_infinity;
  // Whether all points have come to lie within a millionth of the distance of
  // the nearest camera.
  bool is_in_one_place = false;

  bool Any() const {
    return is_in_one_place || !in_camera.empty() || !at_infinity.empty();
  }
  // Whether most points are part of it: then nothing is left of the scene.
  bool IsWhole() const {
    return is_in_one_place ||
           2 * static_cast<int64_t>(in_camera.size() + at_infinity.size()) >
               num_points;
  }
};

// Finds what has degenerated between two models with the same images. The
// second model's points must be among the first's. Only what was a hundred
// times less degenerate before, or had no finite position, counts. Requires
// valid models. O(observations).
Collapse FindCollapse(const Model& before, const Model& after,
                      const Context& context = {});

}  // namespace krot::internal
