#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/certificate_file.h"
#include "krot/convert/pixel_certificate.h"
#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/outliers.h"
#include "krot/outliers/conflict.h"
#include "krot/outliers/removal.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// How low the largest error can be without some of the observations, and from
// where on that is no noise.

// What Gaussian noise explains.
struct NoiseLimit {
  double sigma = 0;  // per axis, pixels
  // In a model of such noise alone no error is above this with a probability of
  // 95 %; true pixels of the norm; > 0.
  double max_error = 0;
};

// The sigma that SnoopNoise ends with, at the cameras of the model or of
// FindRobustStart, moved on to a robust least squares, whichever has less: the
// latter do not mind a start that is off. One of N errors is above
// sigma sqrt(2 ln(N / 0.05)) with a probability of 5 % at most (Bonferroni).
// Nothing below a thousandth of a pixel is told from rounding. Takes less than
// a solve.
NoiseLimit FindNoiseLimit(const Model& model, const BuiltProblem& built,
                          Norm norm, const Context& context);

// The same at built.start alone. O(observations).
NoiseLimit NoiseLimitAtStart(const Model& model, const BuiltProblem& built,
                             Norm norm, const Context& context);

struct ErrorProfileOptions {
  Norm norm;
  // The last level's largest error, true pixels; > 0. None: half of the first
  // or, if that is lower and the first is above it, what noise explains.
  std::optional<double> max_error;
  double relative_gap = 1e-3;  // of every level; > 0
  int num_levels = 6;          // about, below the first; >= 1
  // Levels with more observations removed are asked for no conflicts of their
  // own.
  size_t max_charged = 50;
};

struct ProfileLevel {
  // What is left out, and where all others are within max_error.
  Removal removal;
  double max_error = 0;  // true pixels
  // That no translations and points bring all others below; true pixels, 0
  // without a proof, which CheckPixelCertificate accepted otherwise.
  double lower_bound = 0;
  std::optional<PixelCertificate> proof;  // of the built problem
  // So many must go at least for all others to be within max_error: the first
  // so many conflicts of the profile.
  int64_t num_proved = 0;
};

struct ErrorProfile {
  // More removed and a lower maximum from each to the next; nothing is removed
  // in the first.
  std::vector<ProfileLevel> levels;
  std::vector<Conflict> conflicts;  // disjoint
  NoiseLimit noise;
  // Where what is no noise ends: the first level that noise explains, if it is
  // proved that the one of all observations is above that. None: noise explains
  // them all, as far as is proved, or none of the levels.
  std::optional<size_t> elbow;
};

// From one optimum to the next: observations are removed for a bound below it
// (RemovalSearch), in equal ratios down to the last, stopping at what noise
// explains, and what is left is solved anew (SolveInRounds). Tracks that keep
// one observation hold nothing any more and have no part in the errors.
// Cancelled, it ends with the levels so far. Every level takes about as long as
// two solves.
ErrorProfile FindErrorProfile(const Model& model, const BuiltProblem& built,
                              const ErrorProfileOptions& options,
                              const Context& context);

// Of the images that have a part in most conflicts, and in no fewer than three,
// the one with most observations removed; none otherwise. Points are placed by
// what the removal leaves of all other images, at their optimum; the turn, with
// the camera's position, is then that of least squares in pixels, errors above
// `bound` counting less (Cauchy). Costs three solves.
std::optional<RotationSuspect> FindRotationSuspect(
    const Model& model, const BuiltProblem& built, const ErrorBound& bound,
    const std::vector<Conflict>& conflicts, const Removal& removal,
    const Context& context);

// Removes observations until all others are within a bound, and proves how many
// had to go: what `krot outlier_filter`, and `krot solver` where not everything
// is to stay, do between reading and writing.

struct OutlierFilterOptions {
  OutlierMethod method = OutlierMethod::kConflicts;
  // The bound, true pixels; > 0. Required by kThreshold. If it is missing, it
  // is what noise explains (FindNoiseLimit), where it is proved that no
  // estimate brings all errors below that; else nothing is removed, and the
  // model stays as it is. From nothing, without a profile, it is what noise
  // explains at the start (NoiseLimitAtStart).
  std::optional<double> max_error;
  // Whether the model's own positions come from nothing but rotations and
  // tracks: then weak parts are looked for there, too.
  bool has_start_from_nothing = false;
  // Whether the model's rotations are others than those that its positions were
  // made with, so that these do not show which observations fit.
  bool has_other_rotations = false;
  bool make_profile = false;   // kConflicts: fill OutlierFilterSummary::profile
  bool find_conflicts = true;  // the proof, most of the time
  // From nothing, without max_error: whether a model stays as it is, unsolved,
  // if perhaps nothing need go (RemovalStart).
  bool spares_what_fits = false;
  // Of what is left; its norm is the errors'. Its init kFeasible is from
  // nothing but rotations and tracks, and so is any model whose cameras have no
  // place or all the same.
  SolveModelOptions solve;

  // Called before the last solve, of what is left; may be empty.
  std::function<void(int64_t num_removed)> on_removed;
};

// The noise of the model, and what it does not explain.
struct NoiseSummary {
  NoiseLimit limit;
  // Of all observations: an estimate's, and what none is below; true pixels.
  double lowest_max_error = 0;
  double lower_bound = 0;  // 0 without a proof

  bool ExplainsAll() const { return !(lower_bound > limit.max_error); }
};

// kSnooping, in numbers.
struct SnoopingSummary {
  // Before the first removal and at the end, pixels; none: no observation is
  // checked by another one, and nothing was done.
  std::optional<double> sigma_before_px;
  std::optional<double> sigma_px;
  double critical_w = 0;  // at the end
  int64_t num_tested = 0;
  int num_rounds = 0;  // of removals with the cameras as they stand
  // What noise explains of an observation at most, critical_w sigma, pixels:
  // the largest bound of the conflicts. Of each it is that times the square
  // root of its redundancy.
  double max_error_px = 0;
  // In the input, of the observations that are kept.
  PixelErrorStatistics kept_error_before;
};

struct OutlierFilterSummary {
  OutlierMethod method = OutlierMethod::kConflicts;
  // True pixels; 0: there is none, as noise explains all errors.
  double max_error = 0;
  std::optional<NoiseSummary> noise;  // with a profile or without a bound
  Norm norm;
  SolveInit init = SolveInit::kModel;  // that was used
  // From nothing: parts that few tracks join, and whether the bound was chosen
  // although nothing fits within what a start may have
  // (SolveModelOptions::init_max_error).
  std::vector<WeakPart> weak_parts;
  bool is_bound_beyond_reason = false;
  // As OutlierFilterOptions::spares_what_fits allows; then max_error is what
  // noise explains, 0 where that does not matter.
  bool is_spared = false;

  int64_t num_observations = 0;  // of the input
  int64_t num_points = 0;
  // That do not fit; worst before first.
  std::vector<RemovedObservation> removed;
  // That fit, but were left alone in their tracks, which went with them.
  int64_t num_left_alone = 0;
  int64_t num_points_removed = 0;
  // So many at least had to go, whatever is done: disjoint conflicts. With
  // kSnooping, for what noise explains of each to be its bound.
  int64_t num_proved = 0;
  // Whether more conflicts were looked for until none was found: the search
  // ends early where hardly anything can be decided.
  bool is_search_complete = true;
  int64_t num_irreducible = 0;            // of the conflicts
  std::optional<ConflictFile> conflicts;  // kConflicts, kSnooping
  // Most removed observations first; those without are left out.
  std::vector<Suspect> tracks, images, cameras;
  std::optional<RotationSuspect> rotation_suspect;

  PixelErrorStatistics pixel_error_before;
  PixelErrorStatistics pixel_error_after;
  // Whether all errors of the result are within the bound, if there is one.
  bool is_within = false;
  std::optional<ErrorProfileSummary> profile;  // if asked for
  std::optional<SnoopingSummary> snooping;     // kSnooping
  std::optional<SolveSummary> solve;  // of what is left; none if nothing is
  int num_solves = 0;

  double seconds_removal = 0;  // wall clock
  double seconds_conflicts = 0;
  double seconds_solve = 0;
};

struct OutlierFilterResult {
  Model model;
  OutlierFilterSummary summary;
};

// A copy of `model` without the observations that do not fit, solved with what
// is left: to the lowest maximum and, below the bound, the least squares; with
// kSnooping to the least squares, or the least of solve.finish.loss. Tracks
// that keep fewer than two go. Everything else is as SolveModel leaves it.
// Requires a valid model; throws what SolveModel does.
OutlierFilterResult FilterOutliers(const Model& model,
                                   const OutlierFilterOptions& options,
                                   const Context& context);

}  // namespace krot::internal
