#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/analysis/model_comparison.h"
#include "krot/base/checkpoint.h"
#include "krot/base/context.h"
#include "krot/base/write_file.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/certificate_file.h"
#include "krot/finish/least_squares.h"
#include "krot/geometry.h"
#include "krot/joint/joint.h"
#include "krot/model.h"
#include "krot/solve.h"
#include "krot/sweeps/res_int.h"

namespace krot::internal {

// What is done after the lowest maximum is reached. That is set by a few
// observations, and the errors of the others may be anything below.
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
  // Replaces that cap; pixels; > 0. There is no finish if the lowest maximum is
  // above it.
  std::optional<double> max_error;
  ErrorLoss loss;
  // Called after every iteration; may be empty.
  std::function<void(const BoundedIterate&)> callback;
};

// The result of a finish by least squares.
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

// Adjusts the model in place, by least squares or a robust loss, and updates
// its stored point errors. Fixed parts stay. `polish` must not be kNone.
PolishSummary PolishModel(Polish polish, const ErrorLoss& loss,
                          const FixedParts& fixed, const Context& context,
                          Model* model);

// As --Solver.polish takes it: "none", "rotations_fixed", "full".
const char* PolishName(Polish polish);

// Images and points that do not hold their place (docs/method/positions.md,
// "What is not determined").

// A point whose observations do not determine whether it is in the scene or
// infinitely far away.
struct LoosePoint {
  Point3DId point3D_id = 0;
  double moved = 0;  // from where the input has it, scene units
};

struct LooseParts {
  std::vector<LooseImage> images;
  std::vector<LoosePoint> points;  // of all ranks
  bool have_moved = false;         // some frame or point was taken back
};

// Gives the estimate of a problem that was built from `model` the place and
// scale that the model's held frames have (gauge.h). Then moves frames and
// points that are not determined towards where the model has them, as far as
// the fit stays equally good: the largest error does not rise, and the sum of a
// frame's or a point's squared errors rises by no more than noise explains.
// Without `update_frames` frames stay where they are. `norm` is that of the
// largest error.
// Fixed ones stay, and so do frames and points with known positions. The same
// bits at any number of threads and ranks. O(observations).
LooseParts SettleEstimate(const Model& model, const BuiltProblem& built,
                          Norm norm, bool update_frames, const Context& context,
                          Estimate* estimate);

// The solve of a COLMAP model: lowers its largest reprojection error. `krot
// solver` and `krot point_triangulator` call it between reading and writing.

// A solve of the linear rows, and the step that was taken towards its solution.
struct Round {
  double linear_cost = 0;                    // of the rows' solution, pixels
  std::optional<double> linear_lower_bound;  // proved for the rows, pixels
  double step = 0;                           // share of the way, in [0, 1]
  double cost = 0;                           // true, after the step, pixels
  std::optional<double> lower_bound;         // highest so far, true pixels
  double seconds = 0;                        // since the solve's start
};

// The factor by which all radii of positions were multiplied so that the
// largest error can be at most `max_error`.
struct PositionFactor {
  double factor = 1;
  // No smaller factor is enough: for radii times this, `certificate` proves
  // that some error exceeds max_error. 1 if there is no certificate.
  double lower_bound = 1;
  double max_error = 0;  // pixels
  std::optional<CertificateFile> certificate;
};

// The findings are those of CheckPixelCertificate, if it accepted the final
// certificate, and the result is the model written, before a polish.
struct SolveSummary : SolveFindings {
  SolveInit init = SolveInit::kModel;  // the one used, not the one asked for
  Norm norm;

  // More of what took part in the optimisation, and what did not.
  int64_t num_frames = 0;
  int64_t num_fixed_frames = 0;
  int64_t num_fixed_points = 0;
  int64_t num_positions = 0;  // known positions
  // The largest ratio of a camera's distance from its known position to the
  // radius, in the model written.
  double largest_position_ratio = 0;
  std::optional<PositionFactor> position_factor;  // if asked for
  int64_t num_retriangulated_points = 0;
  int64_t num_same_image_tracks = 0;  // tracks with an image more than once
  // The largest error of the observations left out as kSameImage, in the model
  // written, pixels. No other error of this summary counts them; only the
  // points' stored errors do.
  double largest_twin_error = 0;

  // The largest true error of the observations in the optimisation, pixels.
  // Initial: at the start, after re-triangulation. Final: of the model written,
  // before a polish. If `is_given_back` that is the input's, and infinite if a
  // point of the input does not project.
  double cost_initial = 0;
  double cost_final = 0;
  std::vector<Round> rounds;
  // The sweeps of all rounds. Costs of sweeps and iterations are those of rows.
  std::vector<Sweep> sweeps;
  // Of the joint solver and of the search for a start. `seconds` counts from
  // the solve's start.
  std::vector<JointIteration> iterations;
  // The size of the joint solver's last working set; none if it did not run.
  std::optional<int64_t> num_working_observations;

  bool is_certified = false;  // CheckPixelCertificate accepted the certificate
  std::optional<CertificateFile> certificate;  // if asked for

  // The input is given back (is_given_back) if the estimate that was found is
  // worse: its largest error in the p-norm, over all observations that had a
  // finite error in the input, is above both the input's largest and
  // finish.max_error; or most of its points fell together (collapse.IsWhole()).
  //
  // For a model whose images and tracks contradict each other: the largest
  // error by the images' side (WorseImagesSide) before and after, pixels in the
  // p-norm. Set where it has become worse and is above finish.max_error; then
  // the input is given back, too. Not measured where ranks share the points.
  std::optional<std::pair<double, double>> worse_images_side;
  // What has degenerated in the estimate, compared with the input.
  Collapse collapse;

  // The images and points that are not determined in the model written.
  LooseParts loose;

  // The finish by least squares, if there was one. It has raised the maximum by
  // cost_final - finish->lowest_cost.
  std::optional<FinishSummary> finish;
  // The lowest maximum that was reached, pixels. The gap asked for refers to
  // this one.
  double LowestCost() const {
    return finish ? finish->lowest_cost : cost_final;
  }

  // Over all observations of the model, including those left out, except
  // those left out as kSameImage.
  PixelErrorStatistics pixel_error_before;
  PixelErrorStatistics pixel_error_after;

  // The final least squares, if asked for. The model returned is the polished
  // one; everything above describes the model before it.
  std::optional<PolishSummary> polish;

  // The expected peak memory of a process that holds the model; see
  // EstimateSolveMemory in stages.h.
  int64_t needed_bytes = 0;

  double seconds_build = 0;  // wall clock
  double seconds_solve = 0;
  std::optional<double> seconds_certify;  // the final check
};

struct SolveModelOptions {
  SolveMethod method = SolveMethod::kAuto;
  SolveInit init = SolveInit::kModel;
  double init_max_error = 100;  // of a start; pixels; > 0
  // For kFeasible, with neither fixed parts nor known positions: where to start
  // if all residuals there are below init_max_error. Otherwise, as without it,
  // a start is looked for. Of the problem that is built without the model's own
  // positions.
  std::optional<Estimate> found_start;
  bool describe_certificate = false;  // fill SolveSummary::certificate
  BuildProblemOptions problem;
  // If given, pixels: the radii of problem.positions are multiplied by the
  // smallest factor, at least 1, at which the largest error can be at most
  // this. That takes some ten solves.
  std::optional<double> inflate_positions_to;
  Polish polish = Polish::kNone;  // of SolveModel

  // Used by all stages instead of the norm in their own options.
  Norm norm;

  // For kResInt. Its fast_descent and callback also serve the sweeps of kAuto,
  // whose numbers continue over all rounds.
  ResIntOptions res_int;
  // For kAuto: the leading sweeps stop when one lowers the cost by less than
  // the tolerance. They make a rough start several times better in the time of
  // a few joint iterations; a good start gains little.
  int max_leading_sweeps = 10;            // >= 0
  double leading_sweep_tolerance = 0.05;  // relative; >= 0
  // For kAuto and kJoint. Its callback is also called for the iterations of the
  // search for a start.
  JointOptions joint;

  FinishOptions finish;  // of kAuto
  // For kAuto with a finish by least squares below finish.max_error: whether
  // the lowest maximum is found and proved first. If not, the finish begins as
  // soon as all errors are below max_error.
  bool find_lowest = true;

  // Used by all stages instead of the one in their own options; null: none.
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
// points and all orders stay. In each connected component the centroid of the
// camera centres stays, and so does their RMS distance to it unless a rig fixes
// the scale; this counts cameras with finite centres only, and not
// summary.loose.images. What options.problem.fixed marks keeps its bits, and
// then determines place and scale. Cameras with options.problem.positions end
// within their radii (to 1e-6 of them), at the lowest maximum that this allows,
// which may be above the input's; the input is not given back then. Positions
// need p = 2, a joint solver and no polish.
//
// Models far from the origin are solved in a local frame
// (krot/model/derived_models.h); costs and errors are those before the
// coordinates are rounded to the model's own.
//
// kAuto looks for a feasible start where the model's own start leaves out
// observations (because they are behind their camera or have no pose) or has
// all centres in one place. For a p without a joint solver and for the paper's
// settings, kAuto means kResInt.
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

// The options for solving points with all frames fixed. Points do not depend on
// each other then, so one sweep solves them. Replaces method, init, polish and
// the number of sweeps.
SolveModelOptions PointsOnly(SolveModelOptions options);

// The method that SolveModel uses for these options.
SolveMethod EffectiveMethod(const SolveModelOptions& options);

// A checkpoint in a file (docs/formats.md). A step counts only if its whole
// record is in the file and matches its digest. So a record that was being
// written when the process was killed or the power failed is ignored.
class CheckpointFile : public Checkpoint {
 public:
  // Opens the file for this process alone, or creates it if there is none.
  // `run` is a digest of what is computed. Throws CheckpointError if the file
  // belongs to another run, is no checkpoint, or is open in another process;
  // throws WriteError if it cannot be written.
  CheckpointFile(const std::filesystem::path& file, const std::string& run);

  // The number of steps that the file held when it was opened.
  int64_t num_steps() const { return num_steps_; }

  std::optional<std::string> Next() override;
  // Forces the record to the disk. After a failure, later calls do nothing.
  void Append(const std::string& record) override;

 private:
  std::string ReadAt(int64_t offset, size_t size) const;
  std::optional<std::string> ReadRecord();
  void WriteBehind(std::initializer_list<std::string_view> parts);

  const std::string name_;
  FileDescriptor descriptor_;
  int64_t num_steps_ = 0;
  int64_t offset_ = 0;      // end of the last record read or appended
  bool is_past_ = false;    // all records that the file held have been read
  bool is_broken_ = false;  // writing has failed
};

}  // namespace krot::internal
