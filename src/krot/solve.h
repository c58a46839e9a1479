#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "krot/context.h"
#include "krot/geometry.h"
#include "krot/model.h"

namespace krot {

// The lowest largest reprojection error that a model's rotations allow, with a
// proof: the known rotation problem in the l-infinity norm [Zhang18]. Rotations
// and intrinsics stay; translations and points move.

enum class SolveMethod {
  kAuto,    // sweeps while they pay, the joint solver, the finish
  kResInt,  // sweeps alone: no bound
  kJoint,   // the joint solver alone
};

enum class SolveInit {
  kModel,     // the model's own translations and points
  kFeasible,  // from nothing but rotations and rays
};

enum class SolveTermination {
  kNotRun,
  kNothingToSolve,  // every observation was left out
  kGapReached,      // a certificate shows the relative gap asked for
  kZeroCost,        // every residual is zero up to rounding: no gap is needed
  // No further progress. Sweeps alone know no bound; of the joint solver's
  // estimates one within 1 % is proved.
  kStalled,
  kUnproved,  // no further progress, and no bound within 1 %: a lower maximum
              // may well exist
  kMaxSweeps,
  kMaxIterations,
  kInfeasible,   // proved: no estimate below init_max_error
  kNoStart,      // no estimate below init_max_error was found
  kWithinBound,  // all errors are below the bound that was asked for, and no
                 // lower maximum was looked for
  kCollapsed,    // most points fell together, into cameras or to infinity
  kInterrupted,  // the estimate is the best so far
};

// Why an observation takes no part in the optimisation. It stays in the model.
enum class LeftOut {
  kBehind,        // does not see its point, even after re-triangulation
  kUndistortion,  // neither a projection nor a trustworthy ray
  kShortTrack,    // fewer than min_track_length usable observations
  kNoPose,        // the image has no frame or no finite translation
  kSameImage,     // its track has a closer one of the same image
  kFixed,         // neither its image nor its point may move
};
inline constexpr int kNumLeftOutReasons = 6;
// "behind", "undistortion", "short_track", "no_pose", "same_image", "fixed".
const char* LeftOutName(LeftOut reason);

// An observation that, with the others of its certificate, sets the maximum.
struct SupportObservation {
  ImageId image_id = 0;
  std::string image_name;
  uint32_t point2D_idx = 0;
  Point3DId point3D_id = 0;
  double multiplier = 0;  // lambda, of a sum of 1
  // Pixels. Infinite behind the camera.
  double error_px = 0;
  bool has_image_twice = false;  // its track
};

// A known position in the support: with all others and the observations it sets
// the maximum.
struct SupportPosition {
  // Whose it is: an image's or, without a name, a point's.
  ImageId image_id = 0;
  std::string image_name;
  Point3DId point3D_id = 0;
  double share = 0;     // of what the positions' rows pull in all
  double distance = 0;  // of the camera or point from it, scene units
  double radius = 0;    // in that direction

  // "a.jpg" or "3D point 12".
  std::string Name() const {
    return image_name.empty() ? "3D point " + std::to_string(point3D_id)
                              : image_name;
  }
};

// An image that does not hold its place (docs/method/positions.md, "What is not
// determined").
struct LooseImage {
  ImageId image_id = 0;
  std::string image_name;
  int64_t num_observations = 0;  // in the optimisation
  // Whether its observations say where it stands: then it is a runaway, which
  // has moved from among the others or to them. If not, it might as well stand
  // farther off by the distance at which cameras typically see.
  bool is_determined = false;
  double moved = 0;  // from where the input has it, scene units
};

// How far a solve is; empty where nothing is known yet.
struct SolveState {
  std::optional<double> max_error;    // the lowest so far, pixels
  std::optional<double> lower_bound;  // the highest proved so far, pixels
};

struct SolveOptions {
  SolveMethod method = SolveMethod::kAuto;
  SolveInit init = SolveInit::kModel;
  double init_max_error = 100;  // pixels; > 0; the start's, if kFeasible
  // Of the errors: p = 1, 2 and infinity have proofs, others kResInt alone.
  Norm norm;
  double relative_gap = 1e-4;  // to the proved bound, of the maximum; > 0
  int max_iterations = 2000;   // of the joint solver, per component; >= 1
  // Usable observations that a point needs to take part; >= 1.
  int min_track_length = 2;
  // Of several observations of one image in a track, only the one with the
  // smallest error takes part.
  bool keep_closest_of_image = false;

  // After the lowest maximum is reached, the least squares of all estimates
  // whose errors stay below (1 + slack) times that (kAuto).
  bool finish_by_least_squares = true;
  double finish_slack = 5e-4;  // > 0
  // Pixels; > 0: the cap of that instead.
  std::optional<double> finish_max_error;

  FixedParts fixed;                      // what must not move
  std::vector<KnownPosition> positions;  // of cameras and points; p = 2

  bool write_certificate = false;  // fill SolveResult::certificate
  // Called again and again while the solve goes on; may be empty.
  std::function<void(const SolveState&)> on_progress;
};

struct SolveResult {
  Model model;  // a copy of the input if nothing better was found
  SolveTermination termination = SolveTermination::kNotRun;
  SolveMethod method = SolveMethod::kAuto;  // that was used

  // True pixels, of the observations that took part: the largest error of the
  // model, the lowest that was reached before the finish by least squares, and
  // what no translations and points can be below with these rotations, proved.
  double max_error = 0;
  double lowest_max_error = 0;
  std::optional<double> lower_bound;
  std::optional<double> relative_gap;  // (max_error - lower_bound) / max_error

  // Of all observations of the model.
  PixelErrorStatistics errors_before;
  PixelErrorStatistics errors_after;

  // What sets the maximum: without these it could be lower.
  std::vector<SupportObservation> support;         // worst first
  std::vector<SupportPosition> support_positions;  // largest share first

  // What took part.
  int64_t num_images = 0;
  int64_t num_points = 0;
  int64_t num_observations = 0;
  int32_t num_components = 0;
  // What did not, by LeftOut.
  std::array<int64_t, kNumLeftOutReasons> left_out = {};
  std::vector<LooseImage> loose_images;
  bool is_given_back = false;       // nothing was better than the input
  bool is_underdetermined = false;  // an error of zero says nothing

  // The proof of lower_bound, if asked for and there is one: JSON, as
  // krot/certificate.h and `krot certificate_checker` take it.
  std::optional<std::string> certificate;
};

// Translations and points with the lowest largest error. Stored point errors
// are updated (mean, true pixels); everything else keeps its bits. So do, per
// connected component, the centroid of the camera centres and their RMS
// distance to it, unless something is fixed. The largest error is never above
// the input's, unless known positions ask for more.
//
// Requires a valid model (ValidateModel). Throws ModelError for cameras without
// an image plane and std::invalid_argument for options out of range. Cancelled,
// it returns the best so far. docs/scale.md has times and memory.
SolveResult Solve(const Model& model, const SolveOptions& options = {},
                  const Context& context = {});

// Moves the points alone, each to its lowest maximum, by the Fast Descent
// Method; method, init and the finish are without effect. Otherwise as Solve,
// without a bound. O(observations).
SolveResult Triangulate(const Model& model, const SolveOptions& options = {},
                        const Context& context = {});

}  // namespace krot
