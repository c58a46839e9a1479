#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/analysis/collapse.h"
#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/certificate_file.h"
#include "krot/finish/least_squares.h"
#include "krot/joint/joint.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/solve.h"
#include "krot/sweeps/res_int.h"

namespace krot::internal {

// What becomes of the room that the lowest maximum leaves: it is set by a few
// observations, and the others may be anywhere below.
enum class Finish {
  kNone,
  kLeastSquares,  // the least squares of all estimates below the cap
};

// As --Solver.finish takes it: "none", "least_squares".
const char* FinishName(Finish finish);

struct FinishOptions {
  Finish finish = Finish::kLeastSquares;
  // eta: every error stays below (1 + slack) times the lowest maximum.
  double slack = 5e-4;  // > 0
  // Pixels; > 0: the cap instead; no finish if the lowest maximum is above it.
  std::optional<double> max_error;
  ErrorLoss loss;
  // Told of every iteration; may be empty.
  std::function<void(const BoundedIterate&)> callback;
};

// Of a finish by least squares.
struct FinishSummary {
  double cap = 0;          // pixels
  double lowest_cost = 0;  // the largest error before it, pixels
  ErrorLoss loss;
  BoundedSummary solve;
  double seconds = 0;
};

// Least squares after the known rotation problem: a lower mean error, for a
// maximum that is no longer the lowest.
enum class Polish {
  kNone,
  kRotationsFixed,  // translations and points
  kFull,            // bundle adjustment with its default options
};

struct PolishSummary {
  Polish polish = Polish::kNone;
  BundleAdjustmentSummary adjustment;
  PixelErrorStatistics pixel_error;  // over all observations, afterwards
};

// Adjusts the model in place, by least squares or the least of a robust loss,
// and updates its stored point errors; what is fixed stays. `polish` must not
// be kNone.
PolishSummary PolishModel(Polish polish, const ErrorLoss& loss,
                          const FixedParts& fixed, const Context& context,
                          Model* model);

// As --Solver.polish takes it: "none", "rotations_fixed", "full".
const char* PolishName(Polish polish);

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

// From a COLMAP model to a COLMAP model with a smaller largest reprojection
// error: what `krot solver` and `krot point_triangulator` do between reading
// and writing.

// A solve of the linear rows, and the step that was taken from it.
struct Round {
  double linear_cost = 0;                    // of the rows' solution, pixels
  std::optional<double> linear_lower_bound;  // proved of the rows, pixels
  double step = 0;                           // of the way there, in [0, 1]
  double cost = 0;                           // true, after it, pixels
  std::optional<double> lower_bound;         // highest so far, true pixels
  double seconds = 0;                        // since the solve's start
};

// By what all radii of positions were multiplied so that the largest error can
// be at most `max_error`.
struct PositionFactor {
  double factor = 1;
  // None below is enough: `certificate` proves an error above max_error for
  // radii times this; 1 without one.
  double lower_bound = 1;
  double max_error = 0;  // pixels
  std::optional<CertificateFile> certificate;
};

struct SolveSummary {
  SolveTermination termination = SolveTermination::kNotRun;
  SolveMethod method = SolveMethod::kAuto;  // that was used, not asked for
  SolveInit init = SolveInit::kModel;       // likewise
  Norm norm;

  // What took part in the optimisation, and what did not.
  int64_t num_frames = 0;
  int64_t num_images = 0;
  int64_t num_points = 0;
  int64_t num_observations = 0;
  int32_t num_components = 0;
  int64_t num_fixed_frames = 0;
  int64_t num_fixed_points = 0;
  int64_t num_positions = 0;  // that are known
  // Of a camera's distance from its position to the radius, of the model
  // written.
  double largest_position_ratio = 0;
  std::optional<PositionFactor> position_factor;  // if asked for
  std::array<int64_t, kNumLeftOutReasons> left_out = {};
  int64_t num_retriangulated_points = 0;
  int64_t num_same_image_tracks = 0;  // that hold an image more than once
  // Of those left out as kSameImage, in the model written, pixels. They count
  // in no error below but the points' own.
  double largest_twin_error = 0;

  // The largest true error of the observations in the optimisation, pixels;
  // initial: of the start, after re-triangulation; final: of the model written
  // (before a polish): the input's if `is_given_back`, then infinite where a
  // point does not project.
  double cost_initial = 0;
  double cost_final = 0;
  std::vector<Round> rounds;
  // Of all rounds. The costs of sweeps and iterations are those of the rows.
  std::vector<Sweep> sweeps;
  // Of the joint solver, and towards a start; seconds since the solve's start.
  std::vector<JointIteration> iterations;
  // That the joint solver looked at in the end; none if it did not run.
  std::optional<int64_t> num_working_observations;

  // What a certificate proves that CheckPixelCertificate accepted in the end.
  bool is_certified = false;
  std::optional<double> lower_bound;  // true pixels
  std::optional<double>
      relative_gap;  // (cost_final - lower_bound) / cost_final, if finite
  std::vector<SupportObservation> support;         // worst first
  std::vector<SupportPosition> support_positions;  // largest share first
  std::optional<CertificateFile> certificate;      // if asked for

  // No estimate was found whose largest error in the p-norm, over all
  // observations that had a finite one, is not above the input's, or above
  // finish.max_error, or most points of the one that was found fell together
  // (collapse.IsWhole()): the input is what is given back.
  bool is_given_back = false;
  // The largest error by the images' side of a model that contradicts itself,
  // pixels in the p-norm, before and after (WorseImagesSide), where it is worse
  // and above finish.max_error: then the input is given back, too. Of a model
  // that is shared by processes it is not measured.
  std::optional<std::pair<double, double>> worse_images_side;
  // What degenerated on the way from the input to the estimate.
  Collapse collapse;
  // Whether the observations are no more numbers than what they determine, so
  // that an error of zero says nothing.
  bool is_underdetermined = false;

  // What does not hold its place in the model written.
  LooseParts loose;

  // The finish by least squares, if there was one: it gives up (cost_final -
  // finish->lowest_cost) of the maximum.
  std::optional<FinishSummary> finish;
  // The largest error that was reached, pixels: what the gap asked for is
  // about.
  double LowestCost() const {
    return finish ? finish->lowest_cost : cost_final;
  }

  // Over all observations of the model, those left out included but for twins.
  PixelErrorStatistics pixel_error_before;
  PixelErrorStatistics pixel_error_after;

  // The least squares step behind all that, if asked for. The model given back
  // is the polished one; everything above speaks of the one before.
  std::optional<PolishSummary> polish;

  // What a process that holds the model is likely to need at its peak; see
  // stages.h.
  int64_t needed_bytes = 0;

  double seconds_build = 0;  // wall clock
  double seconds_solve = 0;
  std::optional<double> seconds_certify;  // the final check
};

struct SolveModelOptions {
  SolveMethod method = SolveMethod::kAuto;
  SolveInit init = SolveInit::kModel;
  double init_max_error = 100;        // pixels; > 0; the start's, if kFeasible
  bool describe_certificate = false;  // fill SolveSummary::certificate
  BuildProblemOptions problem;
  // Pixels; if given, the radii of problem.positions are multiplied by the
  // smallest factor, at least 1, at which the largest error can be at most
  // this. That takes some ten solves.
  std::optional<double> inflate_positions_to;
  Polish polish = Polish::kNone;  // of SolveModel

  // Takes the place of that in the stages' own options.
  Norm norm;

  // kResInt. Its fast_descent and callback serve all sweeps, of which those of
  // kAuto are counted on.
  ResIntOptions res_int;
  // kAuto: the sweeps in front stop when one lowers the cost by less than the
  // tolerance. They make a rough start several times better within the time of
  // a few joint iterations, and do little for a good one.
  int max_leading_sweeps = 10;            // >= 0
  double leading_sweep_tolerance = 0.05;  // relative; >= 0
  // kAuto, kJoint. Its callback is also told of iterations towards a start.
  JointOptions joint;

  FinishOptions finish;  // of kAuto
  // kAuto with a finish by least squares below finish.max_error: whether the
  // lowest maximum is looked for, and proved, first. If not, a start that is
  // below that already goes straight to the finish.
  bool find_lowest = true;

  // Takes the place of that in the stages' own options; null: of none.
  Checkpoint* checkpoint = nullptr;

  // Called once, with the counts filled in, before the solve; may be empty.
  std::function<void(const SolveSummary&)> on_built;
};

struct SolveModelResult {
  // A copy of the input if there is nothing to solve or no start.
  Model model;
  SolveSummary summary;
};

// Re-estimates translations and points and updates the stored point errors
// (mean, true pixels). Rotations, intrinsics, ids, names, tracks, colours, 2D
// points and all orders stay; so do, per connected component, the centroid of
// the camera centres and, unless a rig fixes it, their RMS distance to it,
// where the model has finite ones and but for summary.loose.images. What
// options.problem.fixed marks keeps its bits, and place and scale come from it.
// Cameras with options.problem.positions come to be within their radii (to 1e-6
// of them), at the lowest maximum that leaves; that needs p = 2, a joint solver
// and no polish. It may be above the input's: what is given back then is not
// the input.
//
// Models far from the origin are solved in a local frame
// (krot/model/derived_models.h); costs and errors are those before the
// coordinates are rounded to the model's own.
//
// kAuto takes a feasible start by itself where the model's own would leave out
// observations (as behind or without a pose), has all centres in one place, or
// is still above init_max_error after the leading sweeps; it is kResInt for a p
// without a joint solver and for the paper's settings.
//
// Requires a valid model (ValidateModel); throws ModelError for cameras without
// an image plane and std::invalid_argument for options out of range. Memory:
// see stages.h.
SolveModelResult SolveModel(const Model& model,
                            const SolveModelOptions& options,
                            const Context& context = {});

// The same with all frames fixed: SolveModel with PointsOnly(options).
SolveModelResult TriangulateModel(const Model& model,
                                  const SolveModelOptions& options,
                                  const Context& context = {});

// Points do not depend on each other with the frames fixed, so one sweep is all
// there is: method, init, polish and the number of sweeps are replaced.
SolveModelOptions PointsOnly(SolveModelOptions options);

// The method that SolveModel uses for these options.
SolveMethod EffectiveMethod(const SolveModelOptions& options);

}  // namespace krot::internal
