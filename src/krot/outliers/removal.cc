#include "krot/outliers/removal.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "krot/base/context.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/conic/interior_point.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/reprojection.h"
#include "krot/outliers/outlier_filter.h"
#include "krot/outliers/robust_start.h"
#include "krot/pipeline/stages.h"
#include "krot/problem/subset.h"
#include "krot/sweeps/res_int.h"

namespace krot::internal {
NearSet::NearSet(const KnownRotationProblem& problem)
    : problem_(&problem), contains_(problem.observations.size(), 0) {}

void NearSet::AddAbove(const std::vector<double>& errors, double level) {
  for (int32_t k = 0; k < problem_->num_points; ++k) {
    bool is_near = false;
    for (const int64_t i : problem_->OfPoint(k)) {
      if (!(errors[i] <= level)) contains_[i] = 1;
      is_near = is_near || Contains(i);
    }
    if (is_near) TiePoint(k);
  }
  TieFrames();
}

// Adds observations of a point, evenly along its track, up to six.
void NearSet::TiePoint(int32_t point) {
  const int64_t begin = problem_->point_begin[point];
  const int64_t end = problem_->point_begin[point + 1];
  const int64_t others =
      std::count(&contains_[0] + begin, &contains_[0] + end, 0);
  const int64_t missing = std::min(others, 6 - (end - begin - others));
  int64_t n = 0;
  for (int64_t i = begin; i < end && missing > 0; ++i) {
    if (Contains(i)) continue;
    contains_[i] = (n + 1) * missing / others > n * missing / others;
    ++n;
  }
}

void NearSet::TieFrames() {
  for (int32_t f = 0; f < problem_->num_frames; ++f) {
    std::vector<int64_t> others;
    int64_t missing = 20;
    for (const int32_t i : problem_->OfFrame(f)) {
      if (Contains(i)) {
        --missing;
      } else {
        others.push_back(i);
      }
    }
    for (size_t n = 0; n < others.size() && missing > 0; ++n, --missing) {
      contains_[others[n]] = 1;
      TiePoint(problem_->observations[others[n]].point);
    }
  }
}

std::vector<std::vector<int64_t>> NearSet::Parts() const {
  return SplitIntoComponents(
      *problem_, IndicesWhere(SignedSize(contains_),
                              [&](int64_t i) { return Contains(i); }));
}

namespace {

// It is costly to exceed the bound by less than this share of it.
constexpr double kDear = 0.03;

// The observations whose errors are above a bound.
std::vector<int64_t> Above(const std::vector<double>& errors,
                           double max_error) {
  return IndicesWhere(SignedSize(errors),
                      [&](int64_t i) { return !(errors[i] <= max_error); });
}

}  // namespace

RemovalSearch::RemovalSearch(const Model& model, const BuiltProblem& built,
                             Norm norm, const Context& context)
    : built_(built),
      norm_(norm),
      context_(context),
      reprojection_(model, built),
      rows_(built.problem),
      estimate_(built.start),
      errors_(Errors(estimate_)),
      near_(built.problem) {}

std::vector<double> RemovalSearch::Errors(const Estimate& estimate) const {
  std::vector<double> errors(rows_.observations.size());
  ParallelForEach(static_cast<int64_t>(errors.size()), context_.num_threads,
                  [&](int64_t i) { errors[i] = Error(estimate, i); });
  return errors;
}

std::vector<double> RemovalSearch::WeightsOfErrors() const {
  std::vector<double> excess;
  for (const double error : errors_) {
    excess.push_back(std::clamp(error - max_error_, 0.0, 100 * max_error_));
  }
  return WeightsAgainst(excess, max_error_, kDear);
}

// Solves the slack programme of a connected part, with rows as they are, and
// sets the weights of the next one.
void RemovalSearch::Excess(const std::vector<int64_t>& part,
                           double smallest_mu) {
  const ProblemSubset subset(rows_, part);
  SlackOptions options;
  options.norm = norm_;
  options.smallest_mu = smallest_mu;
  for (const int64_t i : part) options.weights.push_back(weights_[i]);
  Estimate own = subset.Restrict(estimate_);
  // The interior point ends slightly above its optimum.
  const double level = (1 - 1e-3) * max_error_;
  const SlackSolution solution =
      MinimizeSlack(subset.problem(), level, options, context_, &own);
  subset.Replace(own, &estimate_);
  const std::vector<double> weights =
      WeightsAgainst(solution.slack, level, kDear);
  for (size_t n = 0; n < part.size(); ++n) {
    weights_[part[n]] = weights[n];
  }
}

// Solves the programme of the observations that came near the bound. Others
// that it lifts above the bound take part in the next one, weighted by their
// errors.
void RemovalSearch::SolveProgramme(double smallest_mu) {
  reprojection_.TakeRows(estimate_, context_.num_threads, &rows_);
  near_.AddAbove(errors_, max_error_ / 2);
  for (const std::vector<int64_t>& part : near_.Parts()) {
    Excess(part, smallest_mu);
  }
  errors_ = Errors(estimate_);
  const std::vector<double> weights = WeightsOfErrors();
  for (size_t i = 0; i < weights.size(); ++i) {
    if (!near_.Contains(static_cast<int64_t>(i))) weights_[i] = weights[i];
  }
}

// The last programme's estimate, if it removes fewer.
void RemovalSearch::Offer(Removal* best) const {
  std::vector<int64_t> above = Above(errors_, max_error_);
  if (above.size() >= best->observations.size()) return;
  best->observations = std::move(above);
  best->estimate = estimate_;
}

// Every point with removed observations tries to take back the one with the
// smallest error. Returns whether any did.
bool RemovalSearch::TakeBack(Removal* best) {
  std::vector<char> is_removed(rows_.observations.size(), 0);
  for (const int64_t i : best->observations) is_removed[i] = 1;
  std::vector<int64_t> asked;  // one per point, -1: none
  std::vector<int64_t> observations;
  for (int32_t k = 0; k < rows_.num_points; ++k) {
    int64_t nearest = -1;
    double error = 0;
    for (const int64_t i : rows_.OfPoint(k)) {
      if (!is_removed[i]) continue;
      const double own = Error(best->estimate, i);
      if (!std::isfinite(own) || (nearest >= 0 && own >= error)) continue;
      nearest = i;
      error = own;
    }
    if (nearest < 0) continue;
    asked.push_back(nearest);
    for (const int64_t i : rows_.OfPoint(k)) {
      if (!is_removed[i] || i == nearest) observations.push_back(i);
    }
  }
  if (asked.empty()) return false;
  reprojection_.TakeRows(best->estimate, context_.num_threads, &rows_);
  const ProblemSubset part(rows_, observations);
  Estimate own = part.Restrict(best->estimate);
  BlockSweep(part.problem(), FastDescentOptions(), norm_, context_)
      .IntersectPoints(&own);
  Estimate moved = best->estimate;
  part.Replace(own, &moved);
  std::vector<char> is_back(rows_.observations.size(), 0);
  for (const int64_t i : asked) {
    const int32_t k = rows_.observations[i].point;
    bool fits = true;
    for (const int64_t j : rows_.OfPoint(k)) {
      if (is_removed[j] && j != i) continue;
      fits = fits && Error(moved, j) <= max_error_;
    }
    if (!fits) continue;
    best->estimate.points[k] = moved.points[k];
    is_back[i] = 1;
  }
  const size_t before = best->observations.size();
  best->observations.erase(
      std::remove_if(best->observations.begin(), best->observations.end(),
                     [&](int64_t i) { return is_back[i] != 0; }),
      best->observations.end());
  return best->observations.size() < before;
}

Removal RemovalSearch::Find(double max_error, int max_programmes) {
  max_error_ = max_error;
  Removal best;
  best.estimate = built_.start;
  best.observations = Above(Errors(built_.start), max_error_);
  Offer(&best);
  if (weights_.empty()) weights_ = WeightsOfErrors();
  int num_idle = 0;
  for (int n = 0; n < max_programmes && !context_.IsCancelled(); ++n) {
    if (best.observations.empty()) break;
    // After three that remove no fewer, only one more is solved.
    const bool is_last = num_idle == 3 || n + 1 == max_programmes;
    context_.Stage("choosing what to remove, programme", n + 1, max_programmes);
    if (n == 1) near_ = NearSet(built_.problem);  // the start's says little
    SolveProgramme(/*smallest_mu=*/is_last ? 1e-5 : 1e-3);
    const size_t before = best.observations.size();
    Offer(&best);
    if (is_last) break;
    const bool is_idle = n > 0 && best.observations.size() >= before;
    num_idle = is_idle ? num_idle + 1 : 0;
  }
  context_.Stage("taking back what fits");
  while (!context_.IsCancelled() && TakeBack(&best)) {
  }
  return best;
}

Removal FindRemoval(const Model& model, const BuiltProblem& built,
                    const ErrorBound& bound, const Context& context,
                    int max_programmes) {
  return RemovalSearch(model, built, bound.norm, context)
      .Find(bound.max_error, max_programmes);
}

std::vector<int64_t> AllBut(const std::vector<int64_t>& removed, size_t count) {
  return IndicesWhere(static_cast<int64_t>(count), [&](int64_t i) {
    return !std::binary_search(removed.begin(), removed.end(), i);
  });
}

OptimumWithout SolveWithout(const Model& model, const BuiltProblem& built,
                            const std::vector<int64_t>& removed,
                            const Estimate& start, Norm norm,
                            const Context& context) {
  const ProblemSubset subset(
      built.problem,
      PruneUnconstrained(built.problem, AllBut(removed, built.pixels.size())));
  OptimumWithout optimum;
  optimum.estimate = start;
  BuiltProblem part = BuiltPart(built, subset, start);
  if (part.pixels.empty()) return optimum;
  const Reprojection reprojection(model, part);
  Estimate estimate = part.start;
  reprojection.TakeRows(estimate, context.num_threads, &part.problem);
  SolveModelOptions options;
  options.norm = norm;
  options.joint.relative_gap = 1e-3;
  SolveSummary summary;
  optimum.proof =
      SolveInRounds({model, options, SolveMethod::kJoint, context, Timer()},
                    &part, &estimate, &summary);
  optimum.max_error =
      reprojection.TrueCost(estimate, norm, context.num_threads);
  if (optimum.proof) {
    optimum.lower_bound =
        LowerUntilAccepted(model, part, norm, context, &*optimum.proof)
            .lower_bound;
    optimum.proof->rows = InWhole(subset, std::move(optimum.proof->rows));
  }
  subset.Replace(estimate, &optimum.estimate);
  return optimum;
}

namespace {

// Whether observations may be removed if no start satisfies all.
bool AllowsRemoval(const SolveModelOptions& options) {
  return !options.problem.fixed.Any() && options.problem.positions.empty() &&
         EffectiveMethod(options) == SolveMethod::kAuto && options.norm.p == 2;
}

TolerantSolveResult SolveWithoutOutliers(const Model& model,
                                         const TolerantSolveOptions& options,
                                         OutlierFilterOptions::Spared spared,
                                         const Context& context) {
  OutlierFilterOptions filter = options;
  filter.spared = spared;
  filter.solve.on_built = nullptr;
  filter.solve.find_lowest = options.solve.describe_certificate;
  OutlierFilterResult filtered = FilterOutliers(model, filter, context);
  TolerantSolveResult result;
  if (filtered.summary.solve) {
    result.summary = *std::exchange(filtered.summary.solve, std::nullopt);
    result.summary.init = filtered.summary.init;
    result.summary.pixel_error_before = filtered.summary.pixel_error_before;
    result.summary.pixel_error_after = filtered.summary.pixel_error_after;
  } else {
    result.summary.termination = context.IsCancelled()
                                     ? SolveTermination::kInterrupted
                                     : SolveTermination::kNothingToSolve;
  }
  result.model = std::move(filtered.model);
  result.outliers = std::move(filtered.summary);
  return result;
}

}  // namespace

TolerantSolveResult SolveTolerantly(const Model& model,
                                    const TolerantSolveOptions& options,
                                    const Context& context) {
  using Spared = OutlierFilterOptions::Spared;
  if (options.max_error) {
    return SolveWithoutOutliers(model, options, Spared::kNothing, context);
  }
  SolveModelOptions solve = options.solve;
  const bool allows_removal = AllowsRemoval(solve);
  const bool is_from_nothing = solve.init == SolveInit::kFeasible;
  if (!allows_removal || !is_from_nothing) {
    SolveModelResult solved = SolveModel(model, solve, context);
    if (!allows_removal ||
        solved.summary.termination != SolveTermination::kNothingToSolve) {
      return {std::move(solved.model), std::move(solved.summary), std::nullopt};
    }
  }
  RequireOneRank(context, "a start from nothing");
  const bool keeps_all = is_from_nothing && solve.describe_certificate;
  TolerantSolveResult result = SolveWithoutOutliers(
      model, options,
      keeps_all ? Spared::kEverything : Spared::kWhatFitsItsPositions, context);
  if (!result.outliers->is_spared) return result;
  solve.init = SolveInit::kFeasible;
  solve.found_start = std::move(result.outliers->spared_start);
  SolveModelResult solved = SolveModel(model, solve, context);
  const SolveTermination ended = solved.summary.termination;
  if (!keeps_all && (ended == SolveTermination::kNoStart ||
                     ended == SolveTermination::kInfeasible)) {
    return SolveWithoutOutliers(model, options, Spared::kNothing, context);
  }
  return {std::move(solved.model), std::move(solved.summary), std::nullopt};
}

void RemoveChancePairs(const Model& model, std::vector<char>* is_removed) {
  for (const Point3D& point : model.points3D) {
    const auto begin =
        is_removed->begin() + static_cast<int64_t>(point.track_begin);
    const auto end =
        is_removed->begin() + static_cast<int64_t>(point.track_end);
    if (end - begin > 4 && std::count(begin, end, 0) == 2) {
      std::fill(begin, end, 1);
    }
  }
}

}  // namespace krot::internal
