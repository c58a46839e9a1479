#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/context.h"
#include "krot/model.h"
#include "krot/solve.h"

namespace krot {

// Which observations have to go for all others to be within a bound.

enum class OutlierMethod {
  kConflicts,  // few, and a proof of how many at least
  kThreshold,  // what is above the bound, solve, again: to compare with
  kSnooping,   // no bound: what noise does not explain (krot/check.h)
};

struct RemovedObservation {
  ImageId image_id = 0;
  std::string image_name;
  uint32_t point2D_idx = 0;
  Point3DId point3D_id = 0;
  double error_before_px = 0;  // in the input; NaN where there is none
  // Of the result's camera and point; NaN where there is none, as where the
  // point went.
  double error_after_px = 0;
  std::optional<int64_t> conflict;  // that it is in, from 0
  std::optional<double> w;  // kSnooping: as it was removed; infinite: not seen
};

// A track or an image that removed observations or conflicts gather in.
struct Suspect {
  uint64_t id = 0;
  std::string name;  // of an image
  int64_t num_observations = 0;
  int64_t num_removed = 0;
  int64_t num_conflicts = 0;  // that it takes part in
};

// Images that hang on the rest of the model by few tracks, after a start from
// nothing.
struct WeakPart {
  std::vector<std::string> image_names;  // in the order of their ids
  int64_t num_tracks = 0;                // of the input, that both sides see
  int64_t num_agreeing = 0;              // of these, on one place and scale
  double scale_factor = 1;               // that the scale is held to
  bool is_held = true;                   // well enough to rely on it
  // By how much all their rotations would have to turn, degrees, for so many
  // tracks to agree; 0: no turn was found. Nothing is turned.
  double turn_deg = 0;
  int64_t num_agreeing_turned = 0;
};

// How low the largest error can be without some of the observations.
struct ErrorProfileSummary {
  struct Level {
    int64_t num_removed = 0;
    double max_error = 0;  // of all others, true pixels
    std::optional<double> lower_bound;
    int64_t num_proved = 0;
    std::vector<uint64_t> point_ids;  // that lose observations; ascending
  };

  std::vector<Level> levels;
  // The first level that noise explains, if all observations are proved to be
  // above that.
  std::optional<size_t> elbow;
  double seconds = 0;  // wall clock
};

// An image that conflicts gather in, so that its rotation is the suspect:
// known rotations do not move.
struct RotationSuspect {
  ImageId image_id = 0;
  std::string image_name;
  int64_t num_conflicts = 0;  // that it takes part in
  // The turn of its camera, about its own axes, that fits best.
  double angle_deg = 0;
  Eigen::Vector3d axis_in_cam = Eigen::Vector3d::Zero();
  // Of its observations of points that others hold: all, and those above the
  // bound at the best position with its rotation and with the turn.
  int64_t num_observations = 0;
  int64_t num_above = 0;
  int64_t num_above_turned = 0;
  // No translations and points bring all errors below the one with the image;
  // without it they come down to the other. True pixels.
  double lower_bound_with = 0;
  double max_error_without = 0;
};

struct OutlierOptions {
  OutlierMethod method = OutlierMethod::kConflicts;
  // The bound, true pixels; > 0. Required by kThreshold. None: what noise
  // explains; if it is not proved that noise does not explain all, nothing is
  // removed.
  std::optional<double> max_error;
  bool find_conflicts = true;  // the proof, most of the time
  bool make_profile = false;   // kConflicts: fill OutlierResult::profile
  SolveOptions solve;          // of what is left; nothing may be fixed
};

struct OutlierResult {
  Model model;           // without what was removed, solved
  double max_error = 0;  // the bound, true pixels; 0: noise explains all
  // How many observations have to go is in [num_proved, removed.size()].
  std::vector<RemovedObservation> removed;  // largest error first
  int64_t num_proved = 0;                   // conflicts without a common one
  // Whether no more conflicts are to be found.
  bool is_search_complete = true;
  bool is_within = false;      // all errors of the model are within the bound
  int64_t num_left_alone = 0;  // sound, but alone in their tracks
  int64_t num_points_removed = 0;  // with their tracks
  PixelErrorStatistics errors_before;
  PixelErrorStatistics errors_after;
  // What removed observations gather in, most first.
  std::vector<Suspect> tracks, images, cameras;
  std::optional<RotationSuspect> rotation_suspect;
  std::vector<WeakPart> weak_parts;
  std::optional<ErrorProfileSummary> profile;
  // Of what is left; none if nothing is.
  std::optional<SolveTermination> termination;
  std::optional<double> lower_bound;  // true pixels
  // The proof of num_proved: JSON, as krot/certificate.h takes it.
  std::optional<std::string> conflicts;
};

// A copy of `model` without the observations that do not fit, solved with what
// is left: to the lowest maximum and, below the bound, the least squares.
// Tracks that keep fewer than two observations go. Everything else is as Solve
// leaves it. Requires and throws as Solve; takes several solves.
OutlierResult RemoveOutliers(const Model& model,
                             const OutlierOptions& options = {},
                             const Context& context = {});

}  // namespace krot
