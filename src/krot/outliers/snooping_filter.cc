#include "krot/outliers/snooping_filter.h"

#include <string>
#include <utility>
#include <vector>

#include "krot/analysis/noise.h"
#include "krot/base/timer.h"
#include "krot/model/remove_observations.h"
#include "krot/outliers/list_removed.h"
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
    const NoiseSnooping found = SnoopNoise(kept_.model, {}, context_);
    if (!found.noise.sigma_px) return false;
    if (!summary.sigma_before_px) {
      summary.sigma_before_px = found.sigma_path_px.front();
    }
    summary.sigma_px = found.noise.sigma_px;
    summary.critical_w = found.noise.critical_w;
    summary.num_tested = found.noise.num_tested;
    if (found.removed.empty()) return false;
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
    const std::vector<int64_t> no_conflict(is_removed_.size(), -1);
    summary_.removed = ListRemoved(model_, kept_.model, errors_before_,
                                   is_removed_, no_conflict, context_, w_);
    RankSuspects(model_, is_removed_, no_conflict, &summary_);
  }

  const Model& model_;
  const OutlierFilterOptions& options_;
  const Context& context_;
  const std::vector<double> errors_before_;  // per track element
  std::vector<char> is_removed_;
  std::vector<double> w_;  // of what is removed
  RemovedObservations kept_;
  OutlierFilterSummary summary_;
};

}  // namespace

OutlierFilterResult FilterBySnooping(const Model& model,
                                     const OutlierFilterOptions& options,
                                     const Context& context) {
  return SnoopingFilter(model, options, context).Run();
}

}  // namespace krot::internal
