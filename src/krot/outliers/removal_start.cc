#include "krot/outliers/removal_start.h"

#include <algorithm>
#include <sstream>
#include <string>

#include "krot/finish/robust_least_squares.h"
#include "krot/outliers/robust_start.h"
#include "krot/pipeline/start.h"

namespace krot::internal {
namespace {

// Of a bound that is chosen: of the median error, and in pixels.
constexpr double kBoundPerMedian = 10;
constexpr double kLeastBound = 1e-3;

std::string Pixels(double value) {
  std::ostringstream words;
  words.precision(3);
  words << value << " px";
  return words.str();
}

// From nothing; an error is what is above `level`.
void PlaceFromTracks(Norm norm, double level, const Context& context,
                     RemovalStart* start) {
  start->init = SolveInit::kFeasible;
  const KnownRotationProblem& problem = start->built.problem;
  start->built.start = FindRobustStart(problem, norm, level, context);
  MinimizeRobustly(problem, context, &start->built.start);
  context.Note("positions from rotations and tracks: the median error is " +
               Pixels(MedianError(problem, start->built.start, norm)));
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
  const Norm norm = options.solve.norm;
  if (build.ignore_translations) {
    const double level = options.max_error.value_or(kLevelOfStart);
    PlaceFromTracks(norm, std::min(kLevelOfStart, level), context, &start);
  }
  if (start.init == SolveInit::kFeasible && !options.max_error &&
      !options.make_profile) {
    const double median =
        MedianError(start.built.problem, start.built.start, norm);
    start.max_error = std::max(kBoundPerMedian * median, kLeastBound);
    context.Note(
        "leaving out what does not fit within ten times the median "
        "error, " +
        Pixels(start.max_error));
  }
  if (options.has_start_from_nothing) start.init = SolveInit::kFeasible;
  return start;
}

}  // namespace krot::internal
