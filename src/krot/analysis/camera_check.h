#pragma once

#include <vector>

#include "krot/analysis/noise.h"
#include "krot/check.h"
#include "krot/model.h"

namespace krot::internal {

// Finds cameras whose focal length, principal point, distortion or place in
// the rig is wrong: freeing it lowers the sum of squared errors of the camera's
// images by a tenth and more, and by more than noise explains.
//
// One step of bundle adjustment, to first order: with the errors e, and their
// derivatives F by all poses of frames and C by what cameras share, points
// eliminated from both, freeing columns C lowers e'e by
//
//   g' D^-1 g,  D = C'C - C'F (F'F)^-1 F'C,  g = C'e - C'F (F'F)^-1 F'e.
//
// Cameras of fewer images than `least_num_images` are not called wrong. What
// lowers it most goes first, and then the gain of all others beside it is
// found. Takes the observations that `noise` tests; noise.sigma_px must be
// known; `sums` are AddUpImages of both. Where nothing gains as much with the
// poses held, as in a model that was adjusted with all cameras free, the cost
// is O(observations), otherwise that of a step of bundle adjustment. The same
// bits at any number of threads.
std::vector<WrongCamera> FindWrongCameras(const Model& model,
                                          const ModelNoise& noise,
                                          const std::vector<ImageSums>& sums,
                                          int least_num_images,
                                          double false_alarm, int num_threads);

}  // namespace krot::internal
