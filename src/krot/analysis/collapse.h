#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/model.h"

namespace krot::internal {

// Geometry that fits observations because it has degenerated, of a model that
// was estimated: a point in a camera's centre is on any of its rays, parallel
// rays meet anywhere, and where all points are one all cameras see the same.
// None of that shows in errors, which may fall to zero by it.
struct Collapse {
  int64_t num_points = 0;  // that two cameras see
  // By id: whose nearest camera has come to be less than a millionth as far
  // away as the median of those that see it.
  std::vector<Point3DId> in_camera;
  // Whose rays have come to be within a millionth of a radian of each other.
  std::vector<Point3DId> at_infinity;
  // Whether all points have come to lie closer together than a millionth of
  // the distance of the nearest camera.
  bool is_in_one_place = false;

  bool Any() const {
    return is_in_one_place || !in_camera.empty() || !at_infinity.empty();
  }
  // Whether most of the points are part of it: then nothing is left of the
  // scene.
  bool IsWhole() const {
    return is_in_one_place ||
           2 * static_cast<int64_t>(in_camera.size() + at_infinity.size()) >
               num_points;
  }
};

// What degenerated between two models with the same images, of the points of
// the second, which are among the first's: what was a hundred times less so, or
// had no finite position, before. Requires valid models. O(observations).
Collapse FindCollapse(const Model& before, const Model& after,
                      const Context& context = {});

}  // namespace krot::internal
