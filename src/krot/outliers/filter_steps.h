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

// Fills in the tracks, images and cameras of a summary: who has observations
// that were removed, by how many. `conflict_of` says for each track element of
// the input which conflict it is in, -1: none, and `is_removed` whether it was
// removed.
void RankSuspects(const Model& model, const std::vector<char>& is_removed,
                  const std::vector<int64_t>& conflict_of,
                  OutlierFilterSummary* summary);

// Colours that colour-blind eyes tell apart, too [Okabe and Ito].
inline constexpr std::array<uint8_t, 3> kRemovedColor = {213, 94, 0};
inline constexpr std::array<uint8_t, 3> kConflictColor = {0, 114, 178};
inline constexpr std::array<uint8_t, 3> kUnsuspectedColor = {190, 190, 190};

// For COLMAP's GUI: every point of the model that was filtered bears a colour:
// vermilion if an observation of its track was removed, blue if its track only
// takes part in a conflict, otherwise light grey. O(points + conflicts).
void ColorSuspects(const OutlierFilterSummary& summary, Model* model);

// The removed observations of `model`, worst first, with their errors there and
// where `kept`, what is left of it, has their cameras and points. The vectors
// have an entry per track element of `model`: true errors, whether it was
// removed, which conflict it is in, -1: none, and its w, if there is such.
// O(observations).
std::vector<RemovedObservation> ListRemoved(
    const Model& model, const Model& kept,
    const std::vector<double>& errors_before,
    const std::vector<char>& is_removed,
    const std::vector<int64_t>& conflict_of, const Context& context,
    const std::vector<double>& w = {});

// FilterOutliers with OutlierMethod::kSnooping, which asks for no bound. With
// the cameras as they stand, what noise does not explain is removed
// (SnoopNoise). Then translations and points move to the least squares of what
// is left, rotations and intrinsics fixed, and it begins anew, until the least
// squares leaves nothing to remove. As options.solve.finish.loss says, it is
// the least of a robust loss. Where nothing is removed, or there is no sigma,
// as in a model without poses, the model is a copy of the input.
//
// Then conflicts are looked for: no translations and points bring all errors
// within what noise explains of each: critical_w sigma sqrt(r), with r the
// larger eigenvalue of its R_ii (krot/check.h) in its track as it was read.
// What was removed is enough for that, and noise alone has no conflict with
// probability 95 %.
//
// The same bits at any number of threads. Throws ModelError for cameras without
// an image plane.
OutlierFilterResult FilterBySnooping(const Model& model,
                                     const OutlierFilterOptions& options,
                                     const Context& context);

// Where the removal of observations starts.
struct RemovalStart {
  // Of all observations that the start can serve; depths of built.start need
  // not be positive if it is from nothing.
  BuiltProblem built;
  SolveInit init = SolveInit::kModel;
  double max_error = 0;  // the bound: as asked for, or chosen; 0: noise's
  // From nothing without a bound: the start's errors are not far above what
  // noise explains, so that no observation may have to go; or the model has
  // positions of its own, made with these rotations, at which noise explains
  // half of its errors and none is gross (init_max_error).
  bool nearly_fits = false;
  bool fits_its_positions = false;
};

// The model's own start or, if options.solve.init says so or the model has
// none (HasOwnStart), FindRobustStart's. Says which, and the bound.
RemovalStart FindRemovalStart(const Model& model,
                              const OutlierFilterOptions& options,
                              const Context& context);

// SolveModel, without what cannot be served: what `krot solver` does between
// reading and writing.

struct TolerantSolveOptions {
  SolveModelOptions solve;
  // Few observations are removed so that all others are within so many pixels,
  // > 0. None: all stay, unless the start is from nothing, no certificate is
  // asked for, and noise does not explain the lowest maximum (RemovalStart);
  // then what it does not explain is removed.
  std::optional<double> max_error;
  // As OutlierFilterOptions has them.
  bool has_start_from_nothing = false;
  bool has_other_rotations = false;
  bool find_conflicts = false;  // the proof of how many had to go
};

struct TolerantSolveResult {
  // A copy of the input if there is nothing to solve or no start.
  Model model;
  SolveSummary summary;
  // If observations were removed; its own solve is the summary above.
  std::optional<OutlierFilterSummary> outliers;
};

// Requires and throws what SolveModel and FilterOutliers do.
TolerantSolveResult SolveTolerantly(const Model& model,
                                    const TolerantSolveOptions& options,
                                    const Context& context = {});

}  // namespace krot::internal
