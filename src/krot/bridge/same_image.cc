#include "krot/bridge/same_image.h"

namespace krot {

bool HasImageTwice(const Observation* observations, int count) {
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < i; ++j) {
      if (observations[i].view == observations[j].view) return true;
    }
  }
  return false;
}

std::vector<char> ClosestOfImages(const std::vector<ImageGeometry>& images,
                                  const Observation* observations, int count,
                                  const Eigen::Vector3d& xyz) {
  std::vector<double> errors;
  for (int i = 0; i < count; ++i) {
    const Observation& o = observations[i];
    const Eigen::Vector3d wv = o.E * (images[o.view].cam_from_world * xyz);
    errors.push_back(wv.tail<2>().norm() / wv[0]);
  }
  std::vector<char> is_closest(count, 1);
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j < i; ++j) {
      if (observations[i].view != observations[j].view) continue;
      is_closest[errors[i] < errors[j] ? j : i] = 0;
    }
  }
  return is_closest;
}

}  // namespace krot
