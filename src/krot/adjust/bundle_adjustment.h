#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "krot/adjust.h"
#include "krot/base/context.h"
#include "krot/model.h"
#include "krot/model/model_io.h"

namespace krot::internal {

struct BundleAdjustmentResult {
  Model model;  // a copy of the input where nothing was adjusted
  BundleAdjustmentSummary summary;
};

// Minimises the cost from the model's own estimate. Everything that must not
// move or takes no part keeps its bits. The gauge is free during the solve.
// After it, every connected component without anything fixed is moved so that
// it has its former centroid of camera centres, their former RMS distance to it
// (unless a constant rig baseline fixes the scale) and its former mean
// rotation. Cameras that ran away do not count (krot/geometry/transform.h).
// Stored point errors are not updated.
//
// A step that takes a point behind a camera that sees it is rejected; with a
// cap, so is a step that takes an error to the cap. With a cap the result has
// the same bits at any number of threads. Without one, Ceres adds up in no
// fixed order on more than one thread, and the last digits differ from run to
// run.
//
// Requires a valid model (ValidateModel). Throws ModelError for cameras without
// an image plane, std::invalid_argument for options out of range and
// NoCeresError in a build without Ceres.
BundleAdjustmentResult AdjustBundle(const Model& model,
                                    const BundleAdjustmentOptions& options,
                                    const Context& context = {});

// Thrown by a build without Ceres, which cannot adjust.
class NoCeresError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Ceres warns on stderr, through glog, of steps that it could not take, which
// the summary tells as well. From now on, everything in this process that logs
// through glog only prints messages that end the process.
void SilenceCeres();

}  // namespace krot::internal
