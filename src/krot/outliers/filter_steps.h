#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "krot/base/context.h"
#include "krot/convert/build_problem.h"
#include "krot/model.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/pipeline/solve_model.h"

namespace krot::internal {

// Fills in the tracks, images and cameras of a summary: which ones have removed
// observations, and how many. Per track element of the input, `conflict_of` is
// the conflict that it is in, -1: none, and `is_removed` whether it was
// removed.
void RankSuspects(const Model& model, const std::vector<char>& is_removed,
                  const std::vector<int64_t>& conflict_of,
                  OutlierFilterSummary* summary);

// Colours that colour-blind readers can tell apart [Okabe and Ito].
inline constexpr std::array<uint8_t, 3> kRemovedColor = {213, 94, 0};
inline constexpr std::array<uint8_t, 3> kConflictColor = {0, 114, 178};
inline constexpr std::array<uint8_t, 3> kUnsuspectedColor = {190, 190, 190};

// For COLMAP's GUI: colours every point of the filtered model: vermilion if an
// observation of its track was removed, blue if its track only takes part in a
// conflict, otherwise light grey. O(points + conflicts).
void ColorSuspects(const OutlierFilterSummary& summary, Model* model);

// Lists the removed observations of `model`, largest error first, with their
// errors in `model` and with the cameras and points of `kept`, what is left of
// it. The vectors have an entry per track element of `model`: its true error,
// whether it was removed, the conflict that it is in (-1: none) and, if given,
// its w when it was removed. O(observations).
std::vector<RemovedObservation> ListRemoved(
    const Model& model, const Model& kept,
    const std::vector<double>& errors_before,
    const std::vector<char>& is_removed,
    const std::vector<int64_t>& conflict_of, const Context& context,
    const std::vector<double>& w = {});

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

struct TolerantSolveOptions {
  SolveModelOptions solve;
  // The bound in pixels, > 0: a few observations are removed so that all others
  // keep it. Without one all stay, unless the start is from nothing and noise
  // does not explain the lowest maximum (RemovalStart); then the observations
  // that noise does not explain are removed. If a certificate is asked for,
  // this is only so for a model of which SolveModel serves no observation.
  std::optional<double> max_error;
  // As in OutlierFilterOptions.
  bool has_start_from_nothing = false;
  bool has_other_rotations = false;
  bool find_conflicts = false;  // the proof of how many had to go
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
