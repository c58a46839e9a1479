#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "krot/base/context.h"
#include "krot/bridge/bridge.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/solve.h"

namespace krot::internal {

// Images and points that do not hold their place (docs/method/positions.md,
// "What is not determined").

// A point of which its observations do not say whether it is in the scene or
// infinitely far away.
struct LoosePoint {
  Point3DId point3D_id = 0;
  double moved = 0;
};

struct LooseParts {
  std::vector<LooseImage> images;
  std::vector<LoosePoint> points;  // of all ranks
  bool have_moved = false;  // whether any, or any other point, was taken back
};

struct SettleOptions {
  Norm norm;                  // of the largest error
  bool update_frames = true;  // else frames stay, and there is no gauge
};

// Gives the estimate of a problem that was built from `model` the place and
// scale of the model, as its held frames have them, and then moves what is not
// determined as near to where the model has it as is equally good: no largest
// error rises, and the sum of an image's or a point's squared errors by no more
// than noise explains. Frames and points that are fixed or have known positions
// stay. The same bits at any number of threads and ranks. O(observations).
LooseParts SettleEstimate(const Model& model, const BuiltProblem& built,
                          const SettleOptions& options, const Context& context,
                          Estimate* estimate);

// Sets how far the images and points have moved between two models that hold
// the same of both. O(images + points).
void MeasureMoves(const Model& before, const Model& after, LooseParts* loose);

}  // namespace krot::internal
