#include "krot/outliers/outlier_filter.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "krot/base/check.h"
#include "krot/base/timer.h"
#include "krot/model/id_index.h"
#include "krot/model/image_geometry.h"
#include "krot/model/remove_observations.h"
#include "krot/outliers/element_index.h"
#include "krot/outliers/packing.h"
#include "krot/outliers/removal.h"
#include "krot/outliers/removal_start.h"
#include "krot/outliers/suspects.h"
#include "krot/problem/gauge.h"
#include "krot/problem/subset.h"

namespace krot {
namespace {

// What rounding may add to an error on its way into a model, relative.
constexpr double kWithin = 1e-9;
constexpr int kMaxThresholdSolves = 50;
constexpr double kNoError = std::numeric_limits<double>::quiet_NaN();

class OutlierFilter {
 public:
  OutlierFilter(const Model& model, const OutlierFilterOptions& options,
                const Context& context)
      : model_(model),
        options_(options),
        context_(context),
        max_error_(options.max_error),
        errors_before_(PixelErrors(model, context.num_threads)),
        is_removed_(model.track_elements.size(), 0),
        conflict_of_(model.track_elements.size(), -1) {}

  OutlierFilterResult Run();

 private:
  ErrorBound Bound() const { return {options_.solve.norm, max_error_}; }
  bool IsWithin(double error) const {
    return error <= (1 + kWithin) * max_error_;
  }
  void FilterByConflicts();
  void FilterByThreshold();
  void Pack(const BuiltProblem& built, const Removal& removal,
            const std::vector<uint64_t>& elements);
  void PlaceAt(const BuiltProblem& built, const Removal& removal, Model* moved);
  void Solve(Model moved);
  bool RemoveAbove();
  std::vector<double> ErrorsAfter() const;
  void ListRemoved();

  const Model& model_;
  const OutlierFilterOptions& options_;
  const Context& context_;
  double max_error_;                         // the bound, pixels
  const std::vector<double> errors_before_;  // per track element
  std::vector<char> is_removed_;
  std::vector<int64_t> conflict_of_;
  RemovedObservations kept_;  // as of the last solve
  OutlierFilterSummary summary_;
};

// Moves a copy of the input to the removal's estimate, in the input's frame.
void OutlierFilter::PlaceAt(const BuiltProblem& built, const Removal& removal,
                            Model* moved) {
  std::vector<int64_t> kept;
  size_t next = 0;
  for (size_t i = 0; i < built.pixels.size(); ++i) {
    if (next < removal.observations.size() &&
        removal.observations[next] == static_cast<int64_t>(i)) {
      ++next;
    } else {
      kept.push_back(static_cast<int64_t>(i));
    }
  }
  Estimate placed = removal.estimate;
  const ProblemSubset part(built.problem, kept);
  Estimate own = part.Restrict(placed);
  RestoreGaugeIfHarmless(part.problem(), part.Restrict(built.start),
                         options_.solve.norm, context_.num_threads, &own);
  part.Replace(own, &placed);
  *moved = ApplyEstimate(model_, built, placed);
}

void OutlierFilter::Pack(const BuiltProblem& built, const Removal& removal,
                         const std::vector<uint64_t>& elements) {
  const Timer timer;
  std::vector<PixelCertificate> proofs;
  for (Conflict& conflict :
       PackAgainstRemoval(model_, built, Bound(), removal, context_)) {
    for (const int64_t i : conflict.observations) {
      conflict_of_[elements[i]] = summary_.num_proved;
    }
    ++summary_.num_proved;
    summary_.num_irreducible += conflict.is_irreducible;
    proofs.push_back(std::move(conflict.proof));
  }
  summary_.conflicts =
      DescribeConflicts(model_, built, options_.solve.norm, max_error_, proofs);
  summary_.seconds_conflicts = timer.Seconds();
}

// Solves what is left of a model that differs from the input in translations
// and points alone.
void OutlierFilter::Solve(Model moved) {
  const Timer timer;
  kept_ = RemoveObservations(moved, is_removed_);
  if (!kept_.model.track_elements.empty()) {
    // Where all that is left can be within the bound, the least squares there.
    SolveModelOptions options = options_.solve;
    options.init = SolveInit::kModel;
    options.polish = Polish::kNone;
    options.finish.max_error = max_error_;
    SolveModelResult solved = SolveModel(kept_.model, options, context_);
    kept_.model = std::move(solved.model);
    summary_.solve = std::move(solved.summary);
    ++summary_.num_solves;
  }
  summary_.seconds_solve += timer.Seconds();
}

// Removes what is above the bound in the solved model; whether anything was.
bool OutlierFilter::RemoveAbove() {
  const std::vector<double> errors =
      PixelErrors(kept_.model, context_.num_threads);
  bool is_any = false;
  for (size_t n = 0; n < errors.size(); ++n) {
    if (IsWithin(errors[n])) continue;
    is_removed_[kept_.element_of[n]] = 1;
    is_any = true;
  }
  return is_any;
}

void OutlierFilter::FilterByConflicts() {
  const Timer timer;
  const RemovalStart start = FindRemovalStart(model_, options_, context_);
  const BuiltProblem& built = start.built;
  summary_.init = start.init;
  max_error_ = start.max_error;
  const std::vector<uint64_t> elements = ElementsOf(model_, built);
  const Removal removal = FindRemoval(model_, built, Bound(), context_);
  for (const int64_t i : removal.observations) is_removed_[elements[i]] = 1;
  summary_.seconds_removal = timer.Seconds();
  if (context_.IsCancelled()) return;
  if (options_.find_conflicts) Pack(built, removal, elements);
  if (options_.on_removed) {
    options_.on_removed(static_cast<int64_t>(removal.observations.size()));
  }
  Model moved;
  PlaceAt(built, removal, &moved);
  Solve(std::move(moved));
  // What took no part in all that.
  if (!RemoveAbove()) return;
  Model solved = std::move(kept_.model);
  std::vector<char> is_gone(solved.track_elements.size());
  for (size_t n = 0; n < is_gone.size(); ++n) {
    is_gone[n] = is_removed_[kept_.element_of[n]];
  }
  RemovedObservations rest = RemoveObservations(solved, is_gone);
  for (uint64_t& e : rest.element_of) e = kept_.element_of[e];
  rest.num_left_alone += kept_.num_left_alone;
  rest.num_points += kept_.num_points;
  kept_ = std::move(rest);
}

void OutlierFilter::FilterByThreshold() {
  for (size_t e = 0; e < errors_before_.size(); ++e) {
    is_removed_[e] = !IsWithin(errors_before_[e]);
  }
  Model moved = model_;
  do {
    Solve(moved);
  } while (!context_.IsCancelled() &&
           summary_.num_solves < kMaxThresholdSolves && RemoveAbove());
}

// The errors that the input's track elements have in the result; NaN where the
// point went.
std::vector<double> OutlierFilter::ErrorsAfter() const {
  Model model = model_;
  model.frames = kept_.model.frames;
  for (size_t n = 0; n < model.images.size(); ++n) {
    model.images[n].cam_from_world = kept_.model.images[n].cam_from_world;
  }
  const IdIndex<Point3DId> kept_points(kept_.model.points3D);
  for (Point3D& point : model.points3D) {
    const std::optional<int32_t> k = kept_points.Find(point.id);
    point.xyz =
        k ? kept_.model.points3D[*k].xyz : Eigen::Vector3d::Constant(kNoError);
  }
  return PixelErrors(model, context_.num_threads);
}

void OutlierFilter::ListRemoved() {
  const std::vector<double> errors_after = ErrorsAfter();
  const auto image_of = ImageIndices(model_);
  for (const Point3D& point : model_.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!is_removed_[e]) continue;
      const TrackElement& element = model_.track_elements[e];
      RemovedObservation removed;
      removed.image_id = element.image_id;
      removed.image_name = model_.images[image_of.at(element.image_id)].name;
      removed.point2D_idx = element.point2D_idx;
      removed.point3D_id = point.id;
      removed.error_before_px = errors_before_[e];
      removed.error_after_px = errors_after[e];
      if (conflict_of_[e] >= 0) removed.conflict = conflict_of_[e];
      summary_.removed.push_back(std::move(removed));
    }
  }
  std::stable_sort(
      summary_.removed.begin(), summary_.removed.end(),
      [](const RemovedObservation& a, const RemovedObservation& b) {
        const auto key = [](const RemovedObservation& o) {
          return std::isnan(o.error_before_px)
                     ? std::numeric_limits<double>::infinity()
                     : o.error_before_px;
        };
        return key(a) > key(b);
      });
}

OutlierFilterResult OutlierFilter::Run() {
  summary_.method = options_.method;
  summary_.norm = options_.solve.norm;
  summary_.num_observations =
      static_cast<int64_t>(model_.track_elements.size());
  summary_.num_points = static_cast<int64_t>(model_.points3D.size());
  summary_.pixel_error_before = Summarize(errors_before_);
  if (options_.method == OutlierMethod::kConflicts) {
    FilterByConflicts();
  } else {
    FilterByThreshold();
  }
  summary_.max_error = max_error_;
  if (context_.IsCancelled()) return {model_, std::move(summary_)};
  const std::vector<double> errors =
      PixelErrors(kept_.model, context_.num_threads);
  UpdatePointErrors(errors, &kept_.model);
  summary_.pixel_error_after = Summarize(errors);
  summary_.is_within =
      std::all_of(errors.begin(), errors.end(),
                  [this](double error) { return IsWithin(error); });
  summary_.num_left_alone = kept_.num_left_alone;
  summary_.num_points_removed = kept_.num_points;
  ListRemoved();
  RankSuspects(model_, is_removed_, conflict_of_, &summary_);
  if (options_.solve.polish != Polish::kNone && summary_.solve) {
    summary_.solve->polish =
        PolishModel(options_.solve.polish, options_.solve.finish.loss, context_,
                    &kept_.model);
  }
  return {std::move(kept_.model), std::move(summary_)};
}

}  // namespace

OutlierFilterResult FilterOutliers(const Model& model,
                                   const OutlierFilterOptions& options,
                                   const Context& context) {
  CheckArgument(options.max_error > 0 || options.choose_max_error, "max_error",
                options.max_error, "> 0");
  CheckArgument(options.solve.norm.p == 2, "norm.p", options.solve.norm.p,
                "2, that of pixel errors");
  return OutlierFilter(model, options, context).Run();
}

}  // namespace krot
