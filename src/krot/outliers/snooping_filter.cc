#include "krot/outliers/snooping_filter.h"

#include <cmath>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "krot/analysis/noise.h"
#include "krot/base/timer.h"
#include "krot/bridge/reprojection.h"
#include "krot/model/remove_observations.h"
#include "krot/outliers/element_index.h"
#include "krot/outliers/list_removed.h"
#include "krot/outliers/packing.h"
#include "krot/outliers/suspects.h"
#include "krot/pipeline/polish.h"

namespace krot::internal {
namespace {

// Of an input, and what is still left of it.
class SnoopingFilter {
 public:
  SnoopingFilter(const Model& model, const OutlierFilterOptions& options,
                 const Context& context)
      : model_(model),
        options_(options),
        context_(context),
        errors_before_(PixelErrors(model, context.num_threads)),
        is_removed_(model.track_elements.size(), 0),
        w_(model.track_elements.size(), 0),
        conflict_of_(model.track_elements.size(), -1),
        kept_(RemoveObservations(model, is_removed_)) {}

  OutlierFilterResult Run() {
    summary_.method = options_.method;
    summary_.norm = options_.solve.norm;
    summary_.num_observations =
        static_cast<int64_t>(model_.track_elements.size());
    summary_.num_points = static_cast<int64_t>(model_.points3D.size());
    summary_.pixel_error_before = Summarize(errors_before_);
    summary_.snooping.emplace();
    while (Remove()) {
      MoveToLeastSquares();
      if (context_.IsCancelled()) return {model_, std::move(summary_)};
    }
    if (options_.find_conflicts && summary_.snooping->sigma_px) Prove();
    if (context_.IsCancelled()) return {model_, std::move(summary_)};
    Describe();
    return {std::move(kept_.model), std::move(summary_)};
  }

 private:
  // What noise does not explain, cameras as they stand; whether anything was.
  bool Remove() {
    const Timer timer;
    SnoopingSummary& summary = *summary_.snooping;
    ++summary.num_rounds;
    context_.Stage("looking for what noise does not explain");
    NoiseSnooping found = SnoopNoise(kept_.model, {}, context_);
    if (!found.noise.sigma_px) return false;
    if (!summary.sigma_before_px) {
      summary.sigma_before_px = found.sigma_path_px.front();
    }
    summary.sigma_px = found.noise.sigma_px;
    summary.critical_w = found.noise.critical_w;
    summary.num_tested = found.noise.num_tested;
    if (found.removed.empty()) {
      noise_ = std::move(found.noise);
      return false;
    }
    std::vector<char> is_gone(kept_.model.track_elements.size(), 0);
    for (const SnoopedObservation& one : found.removed) {
      is_gone[one.element] = 1;
      is_removed_[kept_.element_of[one.element]] = 1;
      w_[kept_.element_of[one.element]] = one.w;
    }
    for (size_t k = 0; k < kept_.model.points3D.size(); ++k) {
      kept_.model.points3D[k].xyz = found.noise.points[k];
    }
    RemovedObservations rest = RemoveObservations(kept_.model, is_gone);
    for (uint64_t& e : rest.element_of) e = kept_.element_of[e];
    rest.num_left_alone += kept_.num_left_alone;
    rest.num_points += kept_.num_points;
    kept_ = std::move(rest);
    summary_.seconds_removal += timer.Seconds();
    context_.Note(
        "round " + std::to_string(summary.num_rounds) + ": " +
        std::to_string(found.removed.size()) +
        (found.removed.size() == 1 ? " observation is" : " observations are") +
        " more than noise; solving what is left");
    return true;
  }

  void MoveToLeastSquares() {
    const Timer timer;
    context_.Stage("solving what is left");
    Context alone = context_;
    alone.num_threads = 1;  // Ceres' sums depend on it
    PolishModel(Polish::kRotationsFixed, options_.solve.finish.loss, {}, alone,
                &kept_.model);
    ++summary_.num_solves;
    summary_.seconds_solve += timer.Seconds();
  }

  // Bounds for each observation, and conflicts about what was removed.
  void Prove() {
    const Timer timer;
    SnoopingSummary& summary = *summary_.snooping;
    summary.max_error_px = summary.critical_w * *summary.sigma_px;
    BuildProblemOptions options;
    options.num_threads = context_.num_threads;
    BuiltProblem built = BuildProblem(model_, options);
    PlaceAtKept(&built);
    const std::vector<uint64_t> elements = ElementsOf(model_, built);
    ScaleObservations(Scales(elements), &built);
    Reprojection(model_, built)
        .TakeRows(built.start, context_.num_threads, &built.problem);
    Removal removal;
    removal.estimate = built.start;
    for (size_t i = 0; i < elements.size(); ++i) {
      if (!is_removed_[elements[i]]) continue;
      removal.observations.push_back(static_cast<int64_t>(i));
    }
    const ErrorBound bound{Norm::L2(), summary.max_error_px};
    ConflictPacking packing =
        PackAgainstRemoval(model_, built, bound, removal, {}, context_);
    summary_.is_search_complete = packing.is_complete;
    std::vector<PixelCertificate> proofs;
    for (Conflict& conflict : packing.conflicts) {
      for (const int64_t i : conflict.observations) {
        conflict_of_[elements[i]] = summary_.num_proved;
      }
      ++summary_.num_proved;
      summary_.num_irreducible += conflict.is_irreducible;
      proofs.push_back(std::move(conflict.proof));
    }
    summary_.conflicts =
        DescribeConflicts(model_, built, bound.norm, bound.max_error, proofs);
    summary_.seconds_conflicts = timer.Seconds();
  }

  // The start of a problem of the input is where what is kept stands.
  void PlaceAtKept(BuiltProblem* built) const {
    for (size_t f = 0; f < built->frame_of.size(); ++f) {
      built->start.translations[f] =
          kept_.model.frames[built->frame_of[f]].rig_from_world.translation;
    }
    std::unordered_map<Point3DId, size_t> kept;
    for (size_t k = 0; k < kept_.model.points3D.size(); ++k) {
      kept.emplace(kept_.model.points3D[k].id, k);
    }
    for (size_t k = 0; k < built->point_of.size(); ++k) {
      const auto found = kept.find(model_.points3D[built->point_of[k]].id);
      if (found != kept.end())
        built->start.points[k] = noise_.points[found->second];
    }
  }

  // Of observations that are these track elements of the input.
  std::vector<double> Scales(const std::vector<uint64_t>& elements) const {
    std::vector<double> of_element(is_removed_.size(), 1);
    for (size_t n = 0; n < kept_.element_of.size(); ++n) {
      const ObservationNoise& one = noise_.observations[n];
      if (one.num_controlled == 0) continue;
      of_element[kept_.element_of[n]] = std::sqrt(one.redundancy[1]);
    }
    std::vector<double> scales;
    for (const uint64_t e : elements) scales.push_back(of_element[e]);
    return scales;
  }

  void Describe() {
    const std::vector<double> errors =
        PixelErrors(kept_.model, context_.num_threads);
    summary_.pixel_error_after = Summarize(errors);
    std::vector<double> before;
    for (const uint64_t e : kept_.element_of) {
      before.push_back(errors_before_[e]);
    }
    summary_.snooping->kept_error_before = Summarize(before);
    summary_.is_within = true;
    summary_.num_left_alone = kept_.num_left_alone;
    summary_.num_points_removed = kept_.num_points;
    summary_.removed = ListRemoved(model_, kept_.model, errors_before_,
                                   is_removed_, conflict_of_, context_, w_);
    RankSuspects(model_, is_removed_, conflict_of_, &summary_);
  }

  const Model& model_;
  const OutlierFilterOptions& options_;
  const Context& context_;
  const std::vector<double> errors_before_;  // per track element
  std::vector<char> is_removed_;
  std::vector<double> w_;             // of what is removed
  std::vector<int64_t> conflict_of_;  // -1: none
  RemovedObservations kept_;
  ModelNoise noise_;  // of what is kept
  OutlierFilterSummary summary_;
};

}  // namespace

OutlierFilterResult FilterBySnooping(const Model& model,
                                     const OutlierFilterOptions& options,
                                     const Context& context) {
  return SnoopingFilter(model, options, context).Run();
}

}  // namespace krot::internal
