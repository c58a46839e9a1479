#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "krot/base/context.h"
#include "krot/model/fixed_parts.h"
#include "krot/model/model.h"

namespace krot {

// Least squares over everything that a COLMAP model holds: poses, points and
// intrinsics; on Ceres, or below a cap on a Newton system of our own. Names and
// defaults are those of COLMAP 4.1 where it has the option, and differ where a
// comment says so.

enum class RobustLoss { kTrivial, kSoftL1, kCauchy, kHuber };

struct BundleAdjustmentIteration {
  int iteration = 0;  // 0: the start
  // Half the sum of the robust squared errors, pixels^2; after a step that is
  // not taken, that of before.
  double cost = 0;
  double radius = 0;  // of the trust region
  bool is_successful = false;
  std::optional<double> barrier;  // pixels^2; with a cap
  std::optional<double> cap;      // pixels; with one
  double seconds = 0;             // wall clock, since the start
};

struct BundleAdjustmentOptions {
  // What moves.
  bool refine_focal_length = true;
  bool refine_principal_point = false;
  bool refine_extra_params = true;
  bool refine_rig_from_world = true;
  bool refine_sensor_from_rig = true;
  bool refine_points3D = true;
  bool constant_rig_from_world_rotation = false;

  // Of what may move, what must not. Frames keep their rotations, too, and the
  // sensors through which they see their places in the rig.
  FixedParts fixed;

  // Points with fewer usable observations take no part, if they are not fixed.
  // At least 1; COLMAP's default is 0, which lets points of one ray move along
  // it.
  int min_track_length = 2;

  RobustLoss loss = RobustLoss::kTrivial;
  double loss_scale = 1;  // > 0; pixels

  int max_num_iterations = 100;  // >= 0
  // Without a cap, which has an end of its own (kCapConverged):
  int max_linear_solver_iterations = 200;  // >= 1; iterative solver only
  double function_tolerance = 1e-6;        // relative; >= 0; COLMAP's is 0
  double gradient_tolerance = 1e-4;        // >= 0
  double parameter_tolerance = 0;          // relative; >= 0

  // Up to so many images the reduced camera system is dense, sparse, and
  // beyond them solved by conjugate gradients. Without a cap.
  int max_num_images_direct_dense = 50;     // >= 0
  int max_num_images_direct_sparse = 1000;  // >= 0

  // No error may reach this: pixels; > 0; kTrivial only. The start must be
  // strictly below it.
  std::optional<double> max_error;

  // First moves to a local minimum of the largest error, nearly, and never one
  // above the start's; the cap is then (1 + 5e-4) times that. In place of a
  // max_error; kTrivial only.
  bool lower_max_error = false;

  bool IsBounded() const { return max_error || lower_max_error; }

  // After every iteration; may be empty.
  std::function<void(const BundleAdjustmentIteration&)> callback;
};

enum class BundleAdjustmentTermination {
  kNotRun,
  kNothingToAdjust,  // no observation, or nothing that may move
  kConverged,        // Ceres' function, gradient or parameter tolerance
  kCapConverged,     // duality_gap and stationarity below their tolerances
  kMaxIterations,
  kStalled,          // no step lowers the cost; with a cap: nor is the end a
                     // proved one
  kInfeasibleStart,  // the start is not strictly below max_error
  kInterrupted,      // the model is the best so far
};

struct BundleAdjustmentSummary {
  BundleAdjustmentTermination termination =
      BundleAdjustmentTermination::kNotRun;
  int64_t num_frames = 0;
  int64_t num_images = 0;
  int64_t num_points = 0;
  int64_t num_observations = 0;
  // Observations that took no part: without a pose, behind the camera or not
  // projectable at the start, of too short a track.
  int64_t num_no_pose = 0;
  int64_t num_behind = 0;
  int64_t num_short_track = 0;
  int64_t num_parameters = 0;  // that moved, gauge included

  // Half the sum of the robust squared errors, pixels^2.
  double cost_initial = 0;
  double cost_final = 0;
  int num_iterations = 0;
  std::vector<BundleAdjustmentIteration> iterations;  // without the start
  std::string linear_solver;                          // "dense_schur", ...

  std::optional<double> max_error;  // the cap of the end, pixels
  // With lower_max_error: the local minimum of the largest error, nearly.
  std::optional<double> lowest_max_error;  // pixels

  // At the end: g'D^-1 g / (2 cost), the share of the cost that the unknowns
  // would remove, each moved by itself (g the gradient, D the diagonal of J'J).
  // With a cap both are the barrier problem's, whose gradient is that of
  // the Lagrangian. 0 at a stationary point.
  std::optional<double> stationarity;
  // With a cap: sum of multiplier times slack, relative to the cost. Were
  // the problem convex, no feasible point would be lower by more.
  std::optional<double> duality_gap;
  // Observations whose multiplier is above 1e-3: those that the cap holds.
  int64_t num_active = 0;

  double seconds = 0;  // wall clock
};

struct BundleAdjustmentResult {
  Model model;  // a copy of the input where nothing was adjusted
  BundleAdjustmentSummary summary;
};

// Minimises the cost from the model's own estimate. What may not move keeps its
// bits, and so do points and frames that take no part. The gauge is free during
// the solve; after it every connected component gets back the centroid of its
// camera centres, their RMS distance to it (unless a constant rig baseline
// fixes the scale) and the mean of its rotations, runaways left out
// (krot/geometry/consensus.h); one with anything fixed stays as it is. Stored
// point errors are not updated.
//
// A step that takes a point behind a camera that sees it is rejected; with a
// cap, so is one that takes an error to it. With a cap the result has the same
// bits at any number of threads; without one, Ceres adds up in no fixed order
// on more than one, and the last digits differ from run to run then.
//
// Requires a valid model (ValidateModel). Throws ModelError for cameras without
// an image plane and std::invalid_argument for options out of range.
BundleAdjustmentResult AdjustBundle(const Model& model,
                                    const BundleAdjustmentOptions& options,
                                    const Context& context = {});

// Ceres warns on stderr, through glog, of steps that it could not take; a
// summary says what became of them. From now on only what ends the process is
// printed, of everything in this process that logs through glog.
void SilenceCeres();

}  // namespace krot
