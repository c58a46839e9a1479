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

// Removes observations until all others are within a bound.

enum class OutlierMethod {
  kConflicts,  // removes few, and proves how many must go at least
  kSnooping,   // without a bound: removes what noise does not explain
               // (krot/check.h)
};

struct RemovedObservation {
  ImageId image_id = 0;
  std::string image_name;
  uint32_t point2D_idx = 0;
  Point3DId point3D_id = 0;
  double error_before_px = 0;  // in the input; NaN where there is none
  // In the result; NaN where there is none, as when the point was removed.
  double error_after_px = 0;
  std::optional<int64_t> conflict;  // index of the conflict that it is in
  // KSnooping: when it was removed; infinite: the point was not in front of the
  // camera.
  std::optional<double> w;
};

// A track, image or camera in which removed observations or conflicts
// accumulate.
struct Suspect {
  uint64_t id = 0;
  std::string name;  // of an image
  int64_t num_observations = 0;
  int64_t num_removed = 0;
  int64_t num_conflicts = 0;  // conflicts that it takes part in
};

// After a start from nothing: images whose scale few tracks tie to the rest of
// the model, or none, or a single frame that keeps few of its observations.
struct WeakPart {
  bool is_frame = false;  // a single one, which has no scale of its own
  std::vector<std::string> image_names;  // in the order of their ids
  // Tracks of the input that both sides see, none where the part is a component
  // of its own; a frame's observations.
  int64_t num_tracks = 0;
  int64_t num_of_three = 0;  // of these, tracks of three images or more
  // Of num_tracks, tracks that agree on one place and scale; observations kept.
  int64_t num_agreeing = 0;
  // The part may be larger or smaller by this factor; >= 1.
  double scale_factor = 1;
  bool is_held = true;  // the tracks determine it well enough to be relied on
  // The angle, in degrees, by which all rotations of the part would have to
  // turn for num_agreeing_turned tracks to agree; 0: no such turn was found.
  // This is a diagnosis: rotations are not changed.
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
  // The first level that noise explains. None if it is not proved that noise
  // cannot explain the errors of all observations.
  std::optional<size_t> elbow;
  double seconds = 0;  // wall clock
};

// An image that takes part in many conflicts. Its rotation is the suspect, as
// known rotations do not move.
struct RotationSuspect {
  ImageId image_id = 0;
  std::string image_name;
  int64_t num_conflicts = 0;  // conflicts that it takes part in
  // The rotation of its camera, about the camera's own axes, that fits best.
  double angle_deg = 0;
  Eigen::Vector3d axis_in_cam = Eigen::Vector3d::Zero();
  // Its observations of points that other images determine: all, those above
  // the bound at the best position with the given rotation, and those above it
  // with the best turn.
  int64_t num_observations = 0;
  int64_t num_above = 0;
  int64_t num_above_turned = 0;
  // What the image costs: no translations and points bring all errors below
  // lower_bound_with as long as it takes part; without it they come down to
  // max_error_without. True pixels.
  double lower_bound_with = 0;
  double max_error_without = 0;
};

struct OutlierOptions {
  OutlierMethod method = OutlierMethod::kConflicts;
  // The bound, true pixels; > 0. None: the bound is what noise explains, and
  // nothing is removed unless it is proved that noise does not explain all
  // errors.
  std::optional<double> max_error;
  bool find_conflicts = true;  // the proof, which takes most of the time
  bool make_profile = false;   // kConflicts: fill OutlierResult::profile
  SolveOptions solve;  // of the remaining observations; nothing may be fixed
};

// What was removed, and where such observations accumulate.
struct OutlierFindings {
  double max_error = 0;  // the bound, true pixels; 0: noise explains all
  // The number of observations that must go is in [num_proved, removed.size()].
  std::vector<RemovedObservation> removed;  // largest error first
  int64_t num_proved = 0;  // conflicts that share no observation
  // Whether the search for conflicts ended because there are no more.
  bool is_search_complete = true;
  bool is_within = false;      // all errors of the result are within the bound
  int64_t num_left_alone = 0;  // they fit, but their tracks became too short
  int64_t num_points_removed = 0;  // because their tracks became too short
  // Those with removed observations, most of them first.
  std::vector<Suspect> tracks, images, cameras;
  std::optional<RotationSuspect> rotation_suspect;
  std::vector<WeakPart> weak_parts;  // from nothing
  // From nothing, where the images show no baseline: with rotations turned by
  // at most this, cameras in one place fit as well as those of the result.
  std::optional<double> one_centre_turn_deg;
  std::optional<ErrorProfileSummary> profile;
};

struct OutlierResult : OutlierFindings {
  Model model;  // without what was removed, solved
  PixelErrorStatistics errors_before;
  PixelErrorStatistics errors_after;
  // Of the last solve, of the remaining observations; none if nothing remains.
  std::optional<SolveTermination> termination;
  std::optional<double> lower_bound;  // true pixels
  // The proof of num_proved: JSON, as krot/certificate.h takes it.
  std::optional<std::string> conflicts;
};

// A copy of `model` without the observations that do not fit. The rest is
// solved: to the lowest maximum and, below the bound, to the least squares.
// Tracks that keep fewer than two observations are removed. Everything else is
// as Solve leaves it. Requires and throws as Solve does; takes the time of
// several solves.
OutlierResult RemoveOutliers(const Model& model,
                             const OutlierOptions& options = {},
                             const Context& context = {});

}  // namespace krot
