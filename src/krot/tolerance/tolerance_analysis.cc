#include "krot/tolerance/tolerance_analysis.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <utility>

#include "krot/base/check.h"
#include "krot/base/context.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/conic/cones.h"
#include "krot/model/derived_models.h"
#include "krot/model/model_io.h"
#include "krot/problem/known_rotation_problem.h"
#include "krot/problem/subset.h"

namespace krot::internal {
namespace {

// The inverse of a list of indices in the model: for each of its `count`
// elements the index in the list, or -1.
std::vector<int32_t> InverseOf(const std::vector<int32_t>& of, size_t count) {
  std::vector<int32_t> inverse(count, -1);
  for (size_t n = 0; n < of.size(); ++n) {
    inverse[of[n]] = static_cast<int32_t>(n);
  }
  return inverse;
}

double TrueCostOf(const Model& model, const BuiltProblem& built, Norm norm,
                  const Context& context) {
  return Reprojection(model, built)
      .TrueCost(built.start, norm, context.num_threads);
}

// Finds an estimate within the bound; returns false if none was found. The
// model is solved first unless all its errors are well within.
bool FindModel(const ToleranceOptions& options, const Context& context,
               BuiltProblem* built, ToleranceResult* result) {
  ToleranceSummary& summary = result->summary;
  const Norm norm = options.solve.norm;
  *built = BuildProblem(result->model, options.solve.problem);
  if (!built->problem.observations.empty()) {
    summary.cost = TrueCostOf(result->model, *built, norm, context);
    if (summary.cost <= 0.95 * options.max_error) return true;
  }
  SolveModelOptions solve = options.solve;
  solve.finish.finish = Finish::kNone;
  SolveModelResult solved = SolveModel(result->model, solve, context);
  result->model = std::move(solved.model);
  summary.is_solved = true;
  summary.lower_bound = solved.summary.lower_bound;
  *built = BuildProblem(result->model, options.solve.problem);
  if (built->problem.observations.empty()) return false;
  summary.cost = TrueCostOf(result->model, *built, norm, context);
  return summary.cost < options.max_error;
}

ToleranceGauge GaugeFor(const ToleranceOptions& options,
                        const BuiltProblem& built,
                        const std::vector<int32_t>& view_of,
                        const Context& context) {
  if (HasFixed(built.problem)) return {};
  if (options.gauge_images.empty()) {
    const auto count = static_cast<int64_t>(built.problem.observations.size());
    return ChooseGauge(
        built.problem, built.start,
        FindFarParts(built.problem, NumbersUpTo<int64_t>(count),
                     options.solve.norm, options.max_error, context)
            .frames);
  }
  ToleranceGauge gauge;
  const Components components = FindComponents(built.problem);
  std::vector<int32_t> of_component;
  std::vector<int32_t> frames;
  for (const int32_t image : options.gauge_images) {
    const int32_t view = view_of[image];
    CheckArgument(view >= 0, "gauge_images", image,
                  "images of the optimisation");
    (gauge.first ? gauge.second : gauge.first) = {Pull::Kind::kView, view};
    frames.push_back(built.problem.views[view].frame);
    of_component.push_back(components.of_frame[frames.back()]);
  }
  CheckArgument(frames.size() == 2 && frames[0] != frames[1] &&
                    of_component[0] == of_component[1],
                "gauge_images", options.gauge_images.size(),
                "two images of different frames that share tracks");
  return gauge;
}

void FillBoxes(const ToleranceOptions& options, const ToleranceProblem& problem,
               const std::vector<int32_t>& view_of, const Context& context,
               ToleranceSummary* summary) {
  const Model& model = problem.model();
  const std::vector<int32_t> point_of =
      InverseOf(problem.built().point_of, model.points3D.size());
  const size_t num_images = options.images.size();
  const size_t num_boxes = num_images + options.points.size();
  summary->boxes.resize(num_boxes);
  Context inner = context;
  if (num_boxes > 1) inner.num_threads = 1;
  std::atomic<int64_t> num_done = static_cast<int64_t>(summary->lengths.size());
  const auto fill = [&](size_t n) {
    ToleranceBox& box = summary->boxes[n];
    Pull target;
    box.is_image = n < num_images;
    if (box.is_image) {
      const int32_t i = options.images[n];
      box.id = model.images[i].id;
      box.name = model.images[i].name;
      target = {Pull::Kind::kView, view_of[i]};
    } else {
      const int32_t k = options.points[n - num_images];
      box.id = model.points3D[k].id;
      box.position = model.points3D[k].xyz;
      target = {Pull::Kind::kPoint, point_of[k]};
    }
    if (context.IsCancelled()) return;
    box.is_free = target.index < 0;
    if (!box.is_free) {
      box.position = PositionOf(problem.problem(), problem.centre(), target);
      box.is_free = !IsFixedPosition(problem.problem(), target) &&
                    !problem.UsablePart({target});
      box.box = FindBox(problem, target, options.tolerance, inner);
    }
    if (options.on_box) options.on_box(++num_done);
  };
  ParallelFor(static_cast<int64_t>(num_boxes), 1, context.num_threads,
              [&](int64_t n, int64_t, int) { fill(n); });
  for (const ToleranceBox& box : summary->boxes) {
    summary->num_programmes += box.box.num_programmes;
  }
}

// Finds the least and the greatest length of distances, by a problem of their
// own: its gauge is the scale bar, if there is one and the scale is free.
class LengthFinder {
 public:
  LengthFinder(const ToleranceOptions& options, const ToleranceGauge& gauge,
               const BuiltProblem& built, const Context& context)
      : options_(options), context_(context), gauge_(gauge), built_(built) {}

  // Fills in summary->lengths, around the estimate that `built` starts from.
  void Fill(const Model& model, ToleranceSummary* summary) {
    std::vector<ToleranceLength>& lengths = summary->lengths;
    const std::vector<double> in_model = LengthsOf(model, options_.distances);
    view_of_ = InverseOf(built_.image_of, model.images.size());
    point_of_ = InverseOf(built_.point_of, model.points3D.size());
    for (size_t n = 0; n < options_.distances.size(); ++n) {
      const KnownDistance& distance = options_.distances[n];
      ToleranceLength length;
      length.name = NameOf(model, distance);
      length.metres = distance.metres;
      length.tolerance = distance.tolerance;
      length.length = in_model[n];
      length.is_free = true;
      lengths.push_back(std::move(length));
      targets_.push_back(TargetsOf(distance));
      if (!bar_ && distance.metres) bar_ = n;
    }
    if (bar_) lengths[*bar_].is_bar = true;
    if (bar_ && !targets_[*bar_]) return;
    if (bar_ && gauge_.first && IsScaleFree(built_.problem)) {
      gauge_ = {(*targets_[*bar_])[0], (*targets_[*bar_])[1]};
    }
    const Estimate centre = built_.start;
    const ToleranceProblem problem(model, &built_, centre, gauge_,
                                   options_.solve.norm, options_.max_error,
                                   context_);
    if (bar_) {
      const LengthRange range = Find(problem, *bar_, context_, summary);
      unit_ = BarUnit{in_model[*bar_], range};
    }
    FillOthers(problem, summary);
  }

 private:
  // What lengths are divided by to get metres.
  struct BarUnit {
    double in_model = 0;
    LengthRange range;
  };

  std::optional<std::array<Pull, 2>> TargetsOf(
      const KnownDistance& distance) const {
    std::array<Pull, 2> targets;
    for (int side = 0; side < 2; ++side) {
      const KnownDistance::End& end = distance.ends[side];
      const int32_t index = (end.is_image ? view_of_ : point_of_)[end.index];
      if (index < 0) return std::nullopt;
      targets[side] = {end.is_image ? Pull::Kind::kView : Pull::Kind::kPoint,
                       index};
    }
    return targets;
  }

  LengthRange Find(const ToleranceProblem& problem, size_t n,
                   const Context& context, ToleranceSummary* summary) {
    LengthRange range =
        FindLength(problem, *targets_[n],
                   bar_ && n != *bar_ ? targets_[*bar_] : std::nullopt,
                   options_.tolerance, context);
    summary->lengths[n].is_free = !range.low.proved;
    return range;
  }

  void FillOthers(const ToleranceProblem& problem, ToleranceSummary* summary) {
    std::vector<ToleranceLength>& lengths = summary->lengths;
    Context inner = context_;
    if (lengths.size() > 1) inner.num_threads = 1;
    std::vector<int64_t> num_programmes(lengths.size(), 0);
    std::atomic<int64_t> num_done = 0;
    ParallelFor(static_cast<int64_t>(lengths.size()), 1, context_.num_threads,
                [&](int64_t n, int64_t, int) {
                  const bool is_bar = bar_ && static_cast<size_t>(n) == *bar_;
                  if (context_.IsCancelled() || !targets_[n]) return;
                  const LengthRange range =
                      is_bar ? unit_->range : Find(problem, n, inner, summary);
                  num_programmes[n] = range.num_programmes;
                  InMetres(range, &lengths[n]);
                  if (options_.on_box) options_.on_box(++num_done);
                });
    for (const int64_t count : num_programmes) summary->num_programmes += count;
  }

  // Converts a range to metres, each end by the bar's least favourable length.
  void InMetres(const LengthRange& range, ToleranceLength* length) const {
    length->low = range.low;
    length->high = range.high;
    if (!bar_) return;
    constexpr double kOutwards = 4 * std::numeric_limits<double>::epsilon();
    const KnownDistance& bar = options_.distances[*bar_];
    const double least = std::max(*bar.metres - bar.tolerance, 0.0);
    const double most = *bar.metres + bar.tolerance;
    length->length *= *bar.metres / unit_->in_model;
    length->low.reached *= least / unit_->in_model;
    length->high.reached *= most / unit_->in_model;
    const BoxEnd& low_of_bar = unit_->range.low;
    const BoxEnd& high_of_bar = unit_->range.high;
    if (length->is_bar) {
      length->low = {least, least};
      length->high = {most, most};
      return;
    }
    if (!length->low.proved || !high_of_bar.proved ||
        !(*low_of_bar.proved > 0)) {
      length->low.proved = length->high.proved = std::nullopt;
      length->is_free = true;
      return;
    }
    *length->low.proved *= least / *high_of_bar.proved * (1 - kOutwards);
    *length->high.proved *= most / *low_of_bar.proved * (1 + kOutwards);
  }

  const ToleranceOptions& options_;
  const Context& context_;
  ToleranceGauge gauge_;
  BuiltProblem built_;
  std::vector<int32_t> view_of_;
  std::vector<int32_t> point_of_;
  std::vector<std::optional<std::array<Pull, 2>>> targets_;
  std::optional<size_t> bar_;
  std::optional<BarUnit> unit_;
};

EndAgreement Compare(const std::vector<ToleranceBox>& boxes) {
  EndAgreement agreement;
  for (const ToleranceBox& box : boxes) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const BoxEnd* end : {&box.box.low[axis], &box.box.high[axis]}) {
        ++agreement.num_ends;
        if (!end->proved) continue;
        ++agreement.num_proved;
        const double way = std::abs(*end->proved - box.position[axis]);
        if (!(way > 0)) continue;
        agreement.worst = std::max(agreement.worst,
                                   std::abs(*end->proved - end->reached) / way);
      }
    }
  }
  return agreement;
}

ToleranceResult AnalyzeInFrame(const Model& model,
                               const ToleranceOptions& options,
                               const Context& context) {
  const Timer timer;
  ToleranceResult result;
  result.model = model;
  ToleranceSummary& summary = result.summary;
  summary.max_error = options.max_error;
  summary.norm = options.solve.norm;
  BuiltProblem built;
  const bool has_model = FindModel(options, context, &built, &result);
  const KnownRotationProblem& problem = built.problem;
  summary.num_frames = problem.num_frames;
  summary.num_points = problem.num_points;
  summary.num_observations = static_cast<int64_t>(problem.observations.size());
  if (context.IsCancelled()) {
    summary.termination = ToleranceTermination::kInterrupted;
    return result;
  }
  if (!has_model) {
    summary.termination = problem.observations.empty()
                              ? ToleranceTermination::kNothingToSolve
                              : ToleranceTermination::kNoEstimate;
    return result;
  }
  for (int32_t f = 0; f < problem.num_frames; ++f) {
    summary.num_fixed_frames += problem.IsFixedFrame(f);
  }
  for (int32_t k = 0; k < problem.num_points; ++k) {
    summary.num_fixed_points += problem.IsFixedPoint(k);
  }
  const std::vector<int32_t> view_of =
      InverseOf(built.image_of, result.model.images.size());
  const ToleranceGauge gauge = GaugeFor(options, built, view_of, context);
  for (const std::optional<Pull>& view : {gauge.first, gauge.second}) {
    if (!view) continue;
    summary.gauge_images.push_back(
        result.model.images[built.image_of[view->index]].name);
  }
  if (options.on_box) options.on_box(0);
  const Estimate centre = built.start;
  if (!options.distances.empty()) {
    LengthFinder(options, gauge, built, context).Fill(result.model, &summary);
  }
  const ToleranceProblem shared(result.model, &built, centre, gauge,
                                options.solve.norm, options.max_error, context);
  summary.num_rowless = shared.num_rowless();
  summary.num_far_points = shared.num_far_points();
  FillBoxes(options, shared, view_of, context, &summary);
  summary.agreement = Compare(summary.boxes);
  summary.termination = context.IsCancelled()
                            ? ToleranceTermination::kInterrupted
                            : ToleranceTermination::kDone;
  summary.seconds = timer.Seconds();
  return result;
}

// Moves a box by a vector. Proved ends are rounded outwards, except those of
// what is fixed.
void Shift(const Eigen::Vector3d& by, ToleranceBox* box) {
  for (int axis = 0; axis < 3; ++axis) {
    const double at = box->position[axis];
    box->position[axis] += by[axis];
    for (auto [end, outwards] : {std::pair(&box->box.low[axis], -kInfinity),
                                 std::pair(&box->box.high[axis], kInfinity)}) {
      end->reached += by[axis];
      if (!end->proved) continue;
      const bool is_fixed = *end->proved == at;
      *end->proved += by[axis];
      if (!is_fixed) end->proved = std::nextafter(*end->proved, outwards);
    }
  }
}

void CheckOptions(const Model& model, const ToleranceOptions& options) {
  CheckPositive(options.max_error, "max_error");
  CheckPositive(options.tolerance, "tolerance");
  CheckConic(options.solve.norm);
  const auto check = [](const char* name, const std::vector<int32_t>& indices,
                        size_t count) {
    for (const int32_t index : indices) {
      CheckArgument(index >= 0 && static_cast<size_t>(index) < count, name,
                    index, "an index of the model");
    }
  };
  check("images", options.images, model.images.size());
  check("gauge_images", options.gauge_images, model.images.size());
  check("points", options.points, model.points3D.size());
}

}  // namespace

ToleranceResult AnalyzeTolerances(const Model& model,
                                  const ToleranceOptions& options,
                                  const Context& context) {
  CheckOptions(model, options);
  const FixedParts& fixed = options.solve.problem.fixed;
  const Eigen::Vector3d origin = LocalFrame(model, fixed).origin();
  ToleranceResult result =
      InLocalFrame(LocalFrame(model, fixed), model, [&](const Model& local) {
        return AnalyzeInFrame(local, options, context);
      });
  if (origin.isZero(0)) return result;
  for (ToleranceBox& box : result.summary.boxes) Shift(origin, &box);
  return result;
}

}  // namespace krot::internal
