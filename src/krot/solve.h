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

// Finds the lowest largest reprojection error that a model's rotations allow,
// with a proof: the known rotation problem in the l-infinity norm [Zhang18].
// Rotations and intrinsics stay; translations and points move.

enum class SolveMethod {
  kAuto,    // sweeps while they pay, then the joint solver and the finish
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
  // No further progress. Sweeps alone prove no bound; the estimate of the joint
  // solver is proved to be within 1 %.
  kStalled,
  kUnproved,  // no further progress, and no bound within 1 % was proved: a
              // lower maximum may well exist
  kMaxSweeps,
  kMaxIterations,
  kInfeasible,  // proved: no estimate below init_max_error
  kNoStart,  // none was found below init_max_error, and it is not proved that
             // there is none
  kWithinBound,  // all errors are below the bound that was asked for; no lower
                 // maximum was looked for
  kCollapsed,  // most points fell into each other, into cameras or to infinity
  kInterrupted,  // the estimate is the best one so far
};

// Why an observation takes no part in the optimisation. It stays in the model.
enum class LeftOut {
  kBehind,  // the camera does not see the point, even after re-triangulation
  kUndistortion,  // the pixel has neither a projection nor a trustworthy ray
  kShortTrack,    // fewer than min_track_length usable observations
  kNoPose,        // the image has no frame or no finite translation
  kSameImage,     // the track has a closer observation of the same image
  kFixed,         // neither its image nor its point may move
};
inline constexpr int kNumLeftOutReasons = 6;
// The reason's name in reports: "behind", "undistortion", "short_track",
// "no_pose", "same_image" or "fixed".
const char* LeftOutName(LeftOut reason);

// An observation of the certificate's support: together with the others it sets
// the maximum.
struct SupportObservation {
  ImageId image_id = 0;
  std::string image_name;
  uint32_t point2D_idx = 0;
  Point3DId point3D_id = 0;
  double multiplier = 0;  // lambda; all add up to 1
  // Pixels; infinite if the point is behind the camera.
  double error_px = 0;
  bool has_image_twice = false;  // its track sees the image twice
};

// An observation that the maximum rests on, too, but no proof: the projection
// folds or ends within that maximum of its pixel.
struct FoldObservation {
  ImageId image_id = 0;
  std::string image_name;
  uint32_t point2D_idx = 0;
  CameraId camera_id = 0;
};

// A known position in the certificate's support: together with the others and
// the observations it sets the maximum.
struct SupportPosition {
  // The image's or, if there is no name, the 3D point's.
  ImageId image_id = 0;
  std::string image_name;
  Point3DId point3D_id = 0;
  // How much it holds back: the length of the sum of its rows' gradients
  // (docs/method/proof.md), relative to the sum of these lengths.
  double share = 0;
  // Of the camera or point from the known position, scene units.
  double distance = 0;
  double radius = 0;  // the allowed distance in that direction

  // "a.jpg" or "3D point 12".
  std::string Name() const {
    return image_name.empty() ? "3D point " + std::to_string(point3D_id)
                              : image_name;
  }
};

// An image whose place is not determined, or that has run away from the others
// (docs/method/positions.md, "What is not determined").
struct LooseImage {
  ImageId image_id = 0;
  std::string image_name;
  int64_t num_observations = 0;  // in the optimisation
  // True if its observations determine where it stands: then it is a runaway,
  // which has moved away from the others, or back to them. False if it might as
  // well stand farther off, by the distance at which cameras typically see.
  bool is_determined = false;
  double moved = 0;  // distance from its place in the input, scene units
};

// The progress of a solve; a value is missing while nothing is known yet.
struct SolveState {
  std::optional<double> max_error;    // the lowest so far, pixels
  std::optional<double> lower_bound;  // the highest proved so far, pixels
};

struct SolveOptions {
  SolveMethod method = SolveMethod::kAuto;
  SolveInit init = SolveInit::kModel;
  // A start from nothing must be below it; pixels; > 0. If the model's own
  // estimate stays above it, kAuto looks for such a start, too.
  double init_max_error = 100;
  // The norm of the errors. Only p = 1, 2 and infinity have proofs; any other
  // needs kResInt.
  Norm norm;
  double relative_gap = 1e-4;  // of the maximum to the proved bound; > 0
  int max_iterations = 2000;   // of the joint solver, per component; >= 1
  // Points with fewer usable observations take no part; >= 1.
  int min_track_length = 2;
  // If a track holds several observations of one image, only the one with the
  // smallest error takes part.
  bool keep_closest_of_image = false;

  // The finish: after the lowest maximum is reached, find the least squares
  // among all estimates whose errors stay below (1 + slack) times that maximum
  // (kAuto only).
  bool finish_by_least_squares = true;
  double finish_slack = 5e-4;  // > 0
  // The cap of the finish in pixels, instead of that by finish_slack; > 0.
  std::optional<double> finish_max_error;

  FixedParts fixed;                      // what must not move
  std::vector<KnownPosition> positions;  // known, of cameras and points; p = 2

  bool write_certificate = false;  // fill SolveResult::certificate
  // Called repeatedly during the solve; may be empty.
  std::function<void(const SolveState&)> on_progress;
};

// What took part in a solve, and what was proved.
struct SolveFindings {
  SolveTermination termination = SolveTermination::kNotRun;
  SolveMethod method = SolveMethod::kAuto;  // that was used

  // A proved bound, which no translations and points can be below with these
  // rotations; true pixels.
  std::optional<double> lower_bound;
  // (max - lower_bound) / max, with the largest error of the result.
  std::optional<double> relative_gap;

  // The certificate's support, which sets the maximum: without it the maximum
  // could be lower.
  std::vector<SupportObservation> support;         // worst first
  std::vector<SupportPosition> support_positions;  // largest share first
  std::vector<FoldObservation> at_folds;           // unknown to ranks

  // Counts of what took part.
  int64_t num_images = 0;
  int64_t num_points = 0;
  int64_t num_observations = 0;
  int32_t num_components = 0;
  // Counts of observations that did not, by LeftOut.
  std::array<int64_t, kNumLeftOutReasons> left_out = {};
  bool is_given_back = false;  // nothing better than the input was found
  // No more equations (two per observation) than unknowns: an error of zero
  // says nothing.
  bool is_underdetermined = false;
};

struct SolveResult : SolveFindings {
  Model model;  // a copy of the input if nothing better was found

  // Of the observations that took part, true pixels: the largest error of the
  // result, and the lowest value that it reached, before the finish.
  double max_error = 0;
  double lowest_max_error = 0;
  // Over all observations of the model.
  PixelErrorStatistics errors_before;
  PixelErrorStatistics errors_after;
  std::vector<LooseImage> loose_images;

  // The proof of lower_bound, if it was asked for and exists: JSON that
  // krot/certificate.h and `krot certificate_checker` check.
  std::optional<std::string> certificate;
};

// Finds the translations and points with the lowest largest error. Stored point
// errors are updated (mean, true pixels); everything else keeps its bits.
// Unless something is fixed, each connected component keeps the centroid of its
// camera centres and their RMS distance from it. The largest error is never
// above the input's, unless known positions require it.
//
// Requires a valid model (ValidateModel). Throws ModelError for cameras without
// an image plane and std::invalid_argument for options out of range. Cancelled,
// it returns the best so far. docs/scale.md has times and memory.
SolveResult Solve(const Model& model, const SolveOptions& options = {},
                  const Context& context = {});

// Moves the points alone, each to its lowest maximum, by the Fast Descent
// Method. The options method, init and those of the finish have no effect.
// Otherwise as Solve, but without a bound. O(observations).
SolveResult Triangulate(const Model& model, const SolveOptions& options = {},
                        const Context& context = {});

}  // namespace krot
