#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "krot/analysis/pixel_errors.h"
#include "krot/bridge/bridge.h"
#include "krot/model/model.h"
#include "krot/solver/res_int.h"

namespace krot {

// From a COLMAP model to a COLMAP model with a smaller largest reprojection
// error: what `krot solver` and `krot point_triangulator` do between reading
// and writing.

enum class SolveTermination {
  kNotRun,
  kNothingToSolve,  // every observation was left out
  kStalled,         // the last sweep gained less than the sweep tolerance
  kMaxSweeps,
  kInterrupted,  // the estimate is the best so far
};

struct SolveSummary {
  SolveTermination termination = SolveTermination::kNotRun;
  Norm norm;

  // What took part in the optimisation, and what did not.
  int64_t num_frames = 0;
  int64_t num_images = 0;
  int64_t num_points = 0;
  int64_t num_observations = 0;
  std::array<int64_t, kNumLeftOutReasons> left_out = {};
  int64_t num_retriangulated_points = 0;

  // The largest residual, in pixels linearised at the observations; initial:
  // after re-triangulation.
  double cost_initial = 0;
  double cost_final = 0;
  std::vector<Sweep> sweeps;

  // Over all observations of the model, those left out included.
  PixelErrorStatistics pixel_error_before;
  PixelErrorStatistics pixel_error_after;

  double seconds_build = 0;  // wall clock
  double seconds_solve = 0;
};

struct SolveModelOptions {
  BuildProblemOptions problem;
  // Its num_threads also serves the pixel errors.
  ResIntOptions res_int;
  // Called once, with the counts filled in, before the solve; may be empty.
  std::function<void(const SolveSummary&)> on_built;
};

struct SolveModelResult {
  Model model;  // a copy of the input if there is nothing to solve
  SolveSummary summary;
};

// Re-estimates translations and points by Resection-Intersection and updates
// the stored point errors (mean, true pixels). Rotations, intrinsics, ids,
// names, tracks, colours, 2D points and all orders stay; so do, per connected
// component, the centroid of the camera centres and, unless a rig fixes it,
// their RMS distance to it. Requires a valid model (ValidateModel); throws
// ModelError for cameras without an image plane and std::invalid_argument for
// options out of range. Memory: see EstimateSolveBytes.
SolveModelResult SolveModel(const Model& model,
                            const SolveModelOptions& options);

// The same with all frames fixed. Points do not depend on each other then, so
// one sweep is all there is: `res_int.max_sweeps` and `update_frames` are
// ignored.
SolveModelResult TriangulateModel(const Model& model,
                                  const SolveModelOptions& options);

// About what SolveModel allocates on top of its input, in bytes; the copy of
// the model that it returns is part of that.
int64_t EstimateSolveBytes(const Model& model);

}  // namespace krot
