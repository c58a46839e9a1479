#include "krot/outliers/removal_start.h"

#include <algorithm>
#include <sstream>

#include "krot/outliers/robust_start.h"
#include "krot/pipeline/start.h"

namespace krot {
namespace {

// From nothing, pixels: what is an error is known only afterwards.
constexpr double kLevelOfStart = 2;
// Of a bound that is chosen: of the median error, and in pixels.
constexpr double kBoundPerMedian = 10;
constexpr double kLeastBound = 1e-3;

void PlaceFromTracks(const OutlierFilterOptions& options,
                     const Context& context, RemovalStart* start) {
  start->init = SolveInit::kFeasible;
  const KnownRotationProblem& problem = start->built.problem;
  const Norm norm = options.solve.norm;
  const double level =
      std::min(kLevelOfStart, options.max_error.value_or(kLevelOfStart));
  start->built.start = FindRobustStart(problem, norm, level, context);
  const double median = MedianError(problem, start->built.start, norm);
  std::ostringstream words;
  words.precision(3);
  words << "positions from rotations and tracks: the median error is " << median
        << " px; leaving out what does not fit within ";
  if (!options.max_error && !options.make_profile) {
    start->max_error = std::max(kBoundPerMedian * median, kLeastBound);
    words << kBoundPerMedian << " times that, ";
  }
  words << start->max_error << " px";
  context.Note(words.str());
}

}  // namespace

RemovalStart FindRemovalStart(const Model& model,
                              const OutlierFilterOptions& options,
                              const Context& context) {
  BuildProblemOptions build = options.solve.problem;
  build.num_threads = context.num_threads;
  build.ignore_translations = options.solve.init == SolveInit::kFeasible;
  RemovalStart start;
  start.max_error = options.max_error.value_or(0);
  start.built = BuildProblem(model, build);
  if (!build.ignore_translations && !HasOwnStart(start.built)) {
    build.ignore_translations = true;
    start.built = BuildProblem(model, build);
  }
  if (build.ignore_translations) PlaceFromTracks(options, context, &start);
  return start;
}

}  // namespace krot
