#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "krot/context.h"
#include "krot/model.h"

namespace krot {

// Bundle adjustment of a COLMAP model: least squares over poses, points and
// intrinsics, either plain (by Ceres) or with every error kept below a cap.
// Names and defaults are those of COLMAP 4.1 unless a comment says otherwise.

enum class RobustLoss { kTrivial, kSoftL1, kCauchy, kHuber };

struct BundleAdjustmentIteration {
  int iteration = 0;  // 0: the start
  // Half the sum of the robust squared errors at the current estimate,
  // pixels^2.
  double cost = 0;
  double radius = 0;  // of the trust region
  bool is_successful = false;
  std::optional<double> barrier;  // pixels^2; only with a cap
  std::optional<double> cap;      // pixels; only with a cap
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

  // Parts that must not move. A fixed frame keeps its rotation, too, and the
  // sensors through which it sees keep their poses in the rig.
  FixedParts fixed;

  // Places of cameras and points that are known from elsewhere (GPS, a survey)
  // take part as observations: a region's semi-axes are three standard
  // deviations. Those of what takes no part, or cannot move, are ignored. Not
  // with a cap.
  std::vector<KnownPosition> positions;
  // Distances between cameras and points that are known from elsewhere (scale
  // bars), where the model's unit is the metre: a tolerance is three standard
  // deviations. Those whose ends do not move against each other, or are in
  // parts that no observation ties together, are ignored; Adjust also leaves
  // out those that contradict the others. Not with a cap.
  std::vector<KnownDistance> distances;
  // The noise of a pixel coordinate, against which positions and distances
  // weigh; > 0; pixels. None: the model's sigma_px (krot/check.h), or 1 if it
  // has none.
  std::optional<double> sigma_px;

  // Points with fewer usable observations take no part unless they are fixed;
  // at least 1. COLMAP's default is 0, which lets a point with a single ray
  // move along that ray.
  int min_track_length = 2;

  // With kCauchy, and a start whose median error is above the scale, a second
  // solve begins with that median as its scale; the lower cost is kept. Frames
  // that end with twice the median frame's errors are then moved by themselves,
  // with their points, from a wider loss; if that lowers the cost, all is
  // solved once more.
  RobustLoss loss = RobustLoss::kTrivial;
  double loss_scale = 1;  // > 0; pixels

  int max_num_iterations = 100;  // >= 0
  // The limits below hold without a cap only; kCapConverged tells when a solve
  // with a cap ends.
  int max_linear_solver_iterations = 200;  // >= 1; iterative solver only
  double function_tolerance = 1e-6;        // relative; >= 0; COLMAP's is 0
  double gradient_tolerance = 1e-4;        // >= 0
  double parameter_tolerance = 0;          // relative; >= 0

  // Without a cap: the reduced camera system is solved by a dense factorisation
  // up to the first number of images, and by conjugate gradients above the
  // second; in between by what takes least, which is seldom conjugate
  // gradients.
  int max_num_images_direct_dense = 50;     // >= 0
  int max_num_images_direct_sparse = 1000;  // >= 0

  // The cap: every error stays below this; pixels; > 0; kTrivial only. All
  // errors of the start must be strictly below it.
  std::optional<double> max_error;

  // Instead of max_error: the solver first lowers the largest error nearly to a
  // local minimum, which is at most that of the start, and then takes (1 +
  // 5e-4) times that as the cap. kTrivial only.
  bool lower_max_error = false;

  bool IsBounded() const { return max_error || lower_max_error; }

  // Called after every iteration; may be empty.
  std::function<void(const BundleAdjustmentIteration&)> callback;
};

enum class BundleAdjustmentTermination {
  kNotRun,
  kNothingToAdjust,  // no observation, or nothing that may move
  kConverged,        // Ceres' function, gradient or parameter tolerance
  kCapConverged,     // duality_gap and stationarity below their tolerances
  kMaxIterations,
  kStalled,          // no step lowers the cost, and the tolerances of
                     // kCapConverged are not met
  kInfeasibleStart,  // the start is not strictly below max_error
  kInterrupted,      // the model is the best one so far
};

struct BundleAdjustmentSummary {
  BundleAdjustmentTermination termination =
      BundleAdjustmentTermination::kNotRun;
  int64_t num_frames = 0;
  int64_t num_images = 0;
  int64_t num_points = 0;
  int64_t num_observations = 0;
  // Observations that took no part because they have no pose, are behind the
  // camera or not projectable at the start, or are in too short a track.
  int64_t num_no_pose = 0;
  int64_t num_behind = 0;
  int64_t num_short_track = 0;
  int64_t num_parameters = 0;  // that moved, gauge included
  int64_t num_positions = 0;   // known ones that took part
  // Known ones that took part, in BundleAdjustmentOptions::distances.
  std::vector<int32_t> distances;
  std::optional<double> sigma_px;  // pixel noise, against which they weighed

  // Half the sum of the robust squared errors, and of those of the known
  // positions and distances in pixels, pixels^2.
  double cost_initial = 0;
  double cost_final = 0;
  int num_iterations = 0;
  std::vector<BundleAdjustmentIteration> iterations;  // without the start
  // The scale of the loss in the first of them, where it was not loss_scale;
  // pixels.
  std::optional<double> first_loss_scale;
  int64_t num_moved_frames = 0;  // with kCauchy, by themselves
  std::string linear_solver;     // "dense_schur", ...

  std::optional<double> max_error;  // the cap at the end, pixels
  // With lower_max_error: the lowest largest error that was reached. It is
  // nearly a local minimum if the search for it converged.
  std::optional<double> lowest_max_error;  // pixels
  bool is_lowest_max_error_converged = false;

  // Distance from a stationary point (0 there) at the end: g'D^-1 g / (2 cost),
  // with g the gradient and D the diagonal of J'J. To first order this is the
  // share of the cost that could be removed by moving each unknown alone,
  // summed over the unknowns. With a cap, g and D are those of the barrier
  // problem, whose gradient is that of the Lagrangian.
  std::optional<double> stationarity;
  // With a cap: the sum of multiplier times slack, relative to the cost. If the
  // problem were convex, no feasible point could have a cost lower by more than
  // this.
  std::optional<double> duality_gap;
  // Observations whose multiplier is above 1e-3: the cap holds them back.
  int64_t num_active = 0;

  double seconds = 0;  // wall clock
};

struct AdjustOptions {
  // With adjustment.max_error, a model with errors above it is first brought
  // below it by krot/solve.h, with its rotations as they are; with
  // lower_max_error every model is first brought to its lowest maximum.
  BundleAdjustmentOptions adjustment;
  // Instead of adjustment.max_error: the cap is this many times the lowest
  // maximum that the model's rotations allow; > 1.
  std::optional<double> max_error_factor;
};

struct AdjustResult {
  Model model;  // a copy of the input if nothing was adjusted
  // termination kInfeasibleStart: no estimate below the cap was found.
  BundleAdjustmentSummary summary;
  std::optional<double> max_error;  // the cap at the end, pixels
  // Over all observations of the model, at three stages.
  PixelErrorStatistics errors_before;
  PixelErrorStatistics errors_start;  // where the adjustment began
  PixelErrorStatistics errors_after;
};

// Minimises the sum of (robust) squared errors, starting from the model as it
// is, and stays below the cap if there is one. Everything that must not move or
// takes no part keeps its bits. Every connected component without a fixed part
// keeps its place, scale and mean rotation. Stored point errors are updated.
//
// Requires a valid model (ValidateModel). Throws ModelError for cameras without
// an image plane and std::invalid_argument for options out of range. Without a
// cap and on several threads the last digits differ from run to run, because
// Ceres adds up in no fixed order.
AdjustResult Adjust(const Model& model, const AdjustOptions& options = {},
                    const Context& context = {});

}  // namespace krot
