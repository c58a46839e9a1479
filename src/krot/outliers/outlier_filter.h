#pragma once

#include <array>
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
#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/model/derived_models.h"
#include "krot/outliers.h"
#include "krot/outliers/removal.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// The error profile: how low the largest error can be if some observations are
// left out, and at which level only noise is left.

// What Gaussian noise explains.
struct NoiseLimit {
  double sigma = 0;  // per axis, pixels
  // In a model with such noise alone, no error is above this with a probability
  // of 95 %; true pixels, in the problem's norm; > 0.
  double max_error = 0;
};

// Estimates sigma by SnoopNoise at two sets of cameras, the model's and those
// of FindRobustStart, and takes the smaller one: the latter does not depend on
// the model's positions, which may be off. One of N errors is above
// sigma sqrt(2 ln(N / 0.05)) with a probability of 5 % at most (Bonferroni).
// The limit is at least a thousandth of a pixel, as less cannot be told from
// rounding. Takes less than a solve.
NoiseLimit FindNoiseLimit(const Model& model, const BuiltProblem& built,
                          Norm norm, const Context& context);

struct ErrorProfileOptions {
  Norm norm;
  // The largest error of the last level, true pixels; > 0. None: half of the
  // first level's or, if that is lower and the first level is proved to be
  // above it, what noise explains.
  std::optional<double> max_error;
};

struct ProfileLevel {
  // What is left out, and an estimate at which all others are within max_error.
  Removal removal;
  double max_error = 0;  // true pixels
  // No translations and points bring all others below this; true pixels. 0
  // without a proof; otherwise CheckPixelCertificate accepted it.
  double lower_bound = 0;
  std::optional<PixelCertificate> proof;  // of the built problem
  // At least so many observations must go for all others to be within
  // max_error. The first so many conflicts of the profile prove it.
  int64_t num_proved = 0;
};

struct ErrorProfile {
  // Each level removes more and has a lower maximum than the one before; the
  // first one removes nothing.
  std::vector<ProfileLevel> levels;
  std::vector<Conflict> conflicts;  // disjoint
  NoiseLimit noise;
  // Where only noise is left: the first level that noise explains, if it is
  // proved that the first level of all is above noise. None if that is not
  // proved, or if noise explains none of the levels.
  std::optional<size_t> elbow;
};

// Goes from one optimum to the next: observations are removed for a bound below
// it (RemovalSearch), in about six equal ratios down to the last level, with a
// stop at what noise explains, and the rest is solved anew (SolveWithout).
// Observations that are left alone in their tracks hold nothing and do not
// count. If cancelled, it returns the levels so far. Every level takes about as
// long as two solves.
ErrorProfile FindErrorProfile(const Model& model, const BuiltProblem& built,
                              const ErrorProfileOptions& options,
                              const Context& context);

// Among the images that take part in at least half of the conflicts, and in
// three or more, the one with most observations removed; none if there is no
// such image. Points are placed at the optimum of what the removal leaves of
// all other images; the image's turn and position are then fitted to them by
// least squares in pixels, with less weight for errors above `bound` (Cauchy).
// Costs three solves.
std::optional<RotationSuspect> FindRotationSuspect(
    const Model& model, const BuiltProblem& built, const ErrorBound& bound,
    const std::vector<Conflict>& conflicts, const Removal& removal,
    const Context& context);

// Removes observations until all others are within a bound, and proves how many
// had to go: what `krot outlier_filter`, and `krot solver` where observations
// may go, do between reading and writing.

struct OutlierFilterOptions {
  OutlierMethod method = OutlierMethod::kConflicts;
  // The bound, true pixels; > 0. If it is missing, it is what noise explains
  // (FindNoiseLimit), provided that it is proved that no estimate brings all
  // errors below that; otherwise nothing is removed, and the model stays as it
  // is. From nothing, without a profile, it is what noise explains at the start
  // (FindRemovalStart).
  std::optional<double> max_error;
  // Whether the model's own positions were made from rotations and tracks
  // alone: then weakly tied parts are looked for, too.
  bool has_start_from_nothing = false;
  // Whether the model's positions were made with other rotations than it has,
  // so that they do not show which observations fit.
  bool has_other_rotations = false;
  bool make_profile = false;   // kConflicts: fill OutlierFilterSummary::profile
  bool find_conflicts = true;  // prove how many must go; takes most time
  // From nothing, without max_error: what is given back unsolved.
  enum class Spared { kNothing, kWhatFitsItsPositions, kEverything };
  Spared spared = Spared::kNothing;
  // How what is left is solved; errors are measured in its norm. With init
  // kFeasible the start comes from rotations and tracks alone, as for any model
  // whose cameras have no positions or all the same one.
  SolveModelOptions solve;

  // Called before what is left is solved; may be empty.
  std::function<void(int64_t num_removed)> on_removed;
};

// The noise of the model, and whether it explains all errors.
struct NoiseSummary {
  NoiseLimit limit;
  // Over all observations: an estimate's maximum, and what no maximum is below;
  // true pixels.
  double lowest_max_error = 0;
  double lower_bound = 0;  // 0 without a proof

  bool ExplainsAll() const { return !(lower_bound > limit.max_error); }
};

// What kSnooping found.
struct SnoopingSummary {
  // Noise before the first removal and at the end, pixels. None if no
  // observation is checked by another one; then nothing was done.
  std::optional<double> sigma_before_px;
  std::optional<double> sigma_px;
  double critical_w = 0;  // at the end
  int64_t num_tested = 0;
  int num_rounds = 0;  // removals, each with the cameras fixed
  // What noise explains of an observation at most: critical_w sigma, pixels. In
  // conflicts the bound of each observation is this times the square root of
  // its redundancy.
  double max_error_px = 0;
  // Whether what is kept is at its least squares. If not, these ended higher
  // than the input, and it stays where that has it.
  bool is_solved = true;
  // Errors in the input of the observations that are kept.
  PixelErrorStatistics kept_error_before;
};

struct OutlierFilterSummary : OutlierFindings {
  OutlierMethod method = OutlierMethod::kConflicts;
  std::optional<NoiseSummary> noise;  // with a profile or without a bound
  Norm norm;
  SolveInit init = SolveInit::kModel;  // that was used
  // Whether the bound, chosen by noise, is above what a start may have
  // (SolveModelOptions::init_max_error).
  bool is_bound_beyond_reason = false;
  // Whether the model was given back unsolved (OutlierFilterOptions::spared).
  bool is_spared = false;
  std::optional<Estimate> spared_start;  // if it nearly fits (RemovalStart)

  int64_t num_observations = 0;  // of the input
  int64_t num_points = 0;
  int64_t num_irreducible = 0;            // of the conflicts
  std::optional<ConflictFile> conflicts;  // if they were looked for

  PixelErrorStatistics pixel_error_before;
  PixelErrorStatistics pixel_error_after;
  std::optional<SnoopingSummary> snooping;  // kSnooping
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

// A copy of `model` without the observations that do not fit, with the rest
// solved for the lowest maximum and then the least squares below the bound;
// with kSnooping for the least squares, or the minimum of solve.finish.loss.
// Tracks that keep fewer than two observations go. Everything else is as
// SolveModel leaves it. Requires a valid model; throws what SolveModel does.
OutlierFilterResult FilterOutliers(const Model& model,
                                   const OutlierFilterOptions& options,
                                   const Context& context);

// Colours that colour-blind readers can tell apart [Okabe and Ito].
inline constexpr std::array<uint8_t, 3> kRemovedColor = {213, 94, 0};
inline constexpr std::array<uint8_t, 3> kConflictColor = {0, 114, 178};
inline constexpr std::array<uint8_t, 3> kUnsuspectedColor = {190, 190, 190};

// For COLMAP's GUI: colours every point of the filtered model: vermilion if an
// observation of its track was removed, blue if its track only takes part in a
// conflict, otherwise light grey. O(points + conflicts).
void ColorSuspects(const OutlierFilterSummary& summary, Model* model);

// What all ways to filter have in common: which observations of a model are
// removed, what is kept of it, and the summary.
class Filtering {
 protected:
  Filtering(const Model& model, const OutlierFilterOptions& options,
            const Context& context);

  // Removes more of what is kept: what is marked, by track element of kept_.
  void RemoveMore(const std::vector<char>& is_gone);
  // Takes conflicts, proved for a problem that was built from the model, into
  // the summary. `elements` are the problem's track elements (ElementsOf).
  void TakeConflicts(const BuiltProblem& built,
                     const std::vector<uint64_t>& elements,
                     const ErrorBound& bound, std::vector<Conflict> conflicts);
  // Completes the summary, but for is_within. Returns the errors of what is
  // kept. O(observations).
  std::vector<double> Describe();

  const Model& model_;
  const OutlierFilterOptions& options_;
  const Context& context_;
  // Per track element of the model: its error, whether it was removed, the
  // conflict that it is in (-1: none) and its w when it was removed, unless the
  // last is empty.
  const std::vector<double> errors_before_;
  std::vector<char> is_removed_;
  std::vector<int64_t> conflict_of_;
  std::vector<double> w_;
  RemovedObservations kept_;
  OutlierFilterSummary summary_;
};

// FilterOutliers with OutlierMethod::kSnooping, which needs no bound. It works
// in rounds: with the cameras fixed, observations that noise does not explain
// are removed (SnoopNoise); then translations and points move to the least
// squares of the rest, or to the minimum of the robust loss
// options.solve.finish.loss, with rotations and intrinsics fixed. Rounds end
// when nothing is removed. If nothing ever is, or if no sigma can be estimated,
// as in a model without poses, the model is a copy of the input.
//
// Then conflicts are looked for. The bound of each observation is what noise
// explains of it: critical_w sigma sqrt(r), with r the larger eigenvalue of its
// R_ii (krot/check.h) in its track as it was read. The removal is enough for
// all others to keep their bounds, and noise alone has no conflict with
// probability 95 %.
//
// The same bits at any number of threads. Throws ModelError for cameras without
// an image plane.
OutlierFilterResult FilterBySnooping(const Model& model,
                                     const OutlierFilterOptions& options,
                                     const Context& context);

// Where the search for observations to remove starts.
struct RemovalStart {
  // All observations that the start can serve. Depths at built.start need not
  // be positive if the start is from nothing.
  BuiltProblem built;
  SolveInit init = SolveInit::kModel;
  double max_error = 0;  // the bound, given or chosen; 0: noise is to choose
  // From nothing without a bound: the start's largest error is not far above
  // what noise explains, so that perhaps no observation has to go.
  bool nearly_fits = false;
  // From nothing without a bound: the model has positions that were made with
  // these rotations; noise explains half of their errors, and none exceeds
  // init_max_error.
  bool fits_its_positions = false;
};

// Starts from the model or, if options.solve.init says so or the model has no
// start of its own (HasOwnStart), from FindRobustStart. Chooses the bound, too.
RemovalStart FindRemovalStart(const Model& model,
                              const OutlierFilterOptions& options,
                              const Context& context);

// SolveModel for models with observations that cannot be satisfied: what `krot
// solver` does between reading and writing.
//
// With max_error a few observations are removed so that all others keep it.
// Without it all stay, unless the start is from nothing and the model has no
// positions that fit (RemovalStart); then noise chooses a bound, and what noise
// does not explain is removed. If a certificate is asked for, this is only so
// for a model of which SolveModel serves no observation.

struct TolerantSolveOptions : OutlierFilterOptions {
  TolerantSolveOptions() { find_conflicts = false; }
};

struct TolerantSolveResult {
  // A copy of the input if there is nothing to solve or no start.
  Model model;
  SolveSummary summary;
  // If observations were removed. Its solve is moved to the summary above.
  std::optional<OutlierFilterSummary> outliers;
};

// Requires and throws what SolveModel and FilterOutliers do.
TolerantSolveResult SolveTolerantly(const Model& model,
                                    const TolerantSolveOptions& options,
                                    const Context& context = {});

}  // namespace krot::internal
