#include "krot/outliers/outlier_filter.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>

#include "krot/analysis/noise.h"
#include "krot/base/context.h"
#include "krot/convert/reprojection.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"
#include "krot/outliers/removal.h"
#include "krot/pipeline/solve_model.h"
#include "krot/problem/cost.h"

namespace krot::internal {
namespace {

// Removes observations round by round; kept_ is what is still left of the
// input.
class SnoopingFilter : private Filtering {
 public:
  SnoopingFilter(const Model& model, const OutlierFilterOptions& options,
                 const Context& context)
      : Filtering(model, options, context) {
    w_.assign(model.track_elements.size(), 0);
    kept_ = RemoveObservations(model, is_removed_, /*drops_short=*/false);
  }

  OutlierFilterResult Run() {
    summary_.snooping.emplace();
    while (Remove()) {
      MoveToLeastSquares();
      if (context_.IsCancelled()) return {model_, std::move(summary_)};
    }
    if (const auto sigma_px = summary_.snooping->sigma_px) {
      summary_.snooping->max_error_px =
          summary_.snooping->critical_w * *sigma_px;
      if (options_.find_conflicts) Prove();
    }
    if (context_.IsCancelled()) return {model_, std::move(summary_)};
    StayIfBetter();
    summary_.is_within = true;
    Describe();
    return {std::move(kept_.model), std::move(summary_)};
  }

 private:
  // Removes what noise does not explain, the cameras fixed. Whether anything
  // was.
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
    RemoveMore(is_gone);
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
    if (HasPanorama(kept_.model)) {  // which Ceres does not adjust
      SolveModelOptions options = options_.solve;
      options.init = SolveInit::kModel;
      options.polish = Polish::kNone;
      const std::vector<double> errors =
          PixelErrors(kept_.model, context_.num_threads);
      options.finish.max_error = 1 + 2 * Summarize(errors).max;
      kept_.model = SolveModel(kept_.model, options, context_).model;
    } else {
      Context alone = context_;
      alone.num_threads = 1;  // Ceres' sums depend on it
      PolishModel(Polish::kRotationsFixed, options_.solve.finish.loss, {},
                  alone, &kept_.model);
    }
    ++summary_.num_solves;
    summary_.seconds_solve += timer.Seconds();
  }

  // Where cameras hold points within rounding, the solves may end higher than
  // the input: then what is kept stays there.
  void StayIfBetter() {
    const ErrorLoss& loss = options_.solve.finish.loss;
    std::vector<double> before;
    double cost_before = 0, cost = 0;
    for (const uint64_t e : kept_.element_of) {
      before.push_back(errors_before_[e]);
    }
    const std::vector<double> after =
        PixelErrors(kept_.model, context_.num_threads);
    for (const Point3D& point : kept_.model.points3D) {
      if (point.track_end - point.track_begin < 2) continue;  // not judged
      for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
        cost_before += loss.Value(before[e] * before[e]);
        cost += loss.Value(after[e] * after[e]);
      }
    }
    summary_.snooping->kept_error_before = Summarize(before);
    summary_.snooping->is_solved = cost <= cost_before;
    if (cost <= cost_before) return;
    kept_ = RemoveObservations(model_, is_removed_, /*drops_short=*/false);
  }

  // Sets a bound for each observation, and looks for conflicts of the removed
  // ones.
  void Prove() {
    const Timer timer;
    BuildProblemOptions options;
    options.num_threads = context_.num_threads;
    BuiltProblem built = BuildProblem(model_, options);
    PlaceAtKept(&built);
    const std::vector<uint64_t> elements = ElementsOf(model_, built);
    Reprojection(model_, built)
        .TakeRows(built.start, context_.num_threads, &built.problem);
    ScaleObservations(Scales(built), &built);
    Removal removal;
    removal.estimate = built.start;
    removal.observations = IndicesWhere(SignedSize(elements), [&](int64_t i) {
      return is_removed_[elements[i]] != 0;
    });
    const ErrorBound bound{Norm::L2(), summary_.snooping->max_error_px};
    ConflictPacking packing =
        PackAgainstRemoval(model_, built, bound, removal, {}, context_);
    summary_.is_search_complete = packing.is_complete;
    TakeConflicts(built, elements, bound, std::move(packing.conflicts));
    summary_.seconds_conflicts = timer.Seconds();
  }

  // Moves the start of a problem built from the input to the frames and points
  // of what is kept.
  void PlaceAtKept(BuiltProblem* built) const {
    for (size_t f = 0; f < built->frame_of.size(); ++f) {
      built->start.translations[f] =
          kept_.model.frames[built->frame_of[f]].rig_from_world.translation;
    }
    const IdIndex<Point3DId> kept(kept_.model.points3D);
    for (size_t k = 0; k < built->point_of.size(); ++k) {
      const auto n = kept.Find(model_.points3D[built->point_of[k]].id);
      if (n) built->start.points[k] = noise_.points[*n];
    }
  }

  // Per observation the square root of the larger eigenvalue of its R_ii, from
  // all observations of its point, with the point and the cameras at the start.
  static std::vector<double> Scales(const BuiltProblem& built) {
    const KnownRotationProblem& problem = built.problem;
    std::vector<double> scales;
    for (int32_t k = 0; k < problem.num_points; ++k) {
      std::vector<Eigen::Matrix<double, 2, 3>> rows;
      Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
      for (const int64_t i : problem.OfPoint(k)) {
        const Observation& o = problem.observations[i];
        const View& view = problem.views[o.view];
        const AffineMap map =
            CamFromWorld(view, built.start.translations[view.frame]);
        const Eigen::Vector3d x_cam = InCamera(map, built.start.points[k]);
        const double depth = o.E.row(0).dot(x_cam);
        const Eigen::Vector2d v = o.E.bottomRows<2>() * x_cam / depth;
        Eigen::Matrix<double, 2, 3> J =
            (o.E.bottomRows<2>() - v * o.E.row(0)) / depth * map.leftCols<3>();
        if (!(depth > 0) || !J.allFinite()) J.setZero();
        H += J.transpose() * J;
        rows.push_back(J);
      }
      const Eigen::Matrix3d root = RootOfInverse(H);
      for (const Eigen::Matrix<double, 2, 3>& J : rows) {
        const Eigen::Matrix<double, 2, 3> B = J * root;
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> of_R;
        of_R.computeDirect(Eigen::Matrix2d::Identity() - B * B.transpose(),
                           Eigen::EigenvaluesOnly);
        const double r = of_R.eigenvalues()[1];
        scales.push_back(r > kControlled ? std::sqrt(std::min(r, 1.0)) : 1);
      }
    }
    return scales;
  }

  ModelNoise noise_;  // of what is kept
};

}  // namespace

OutlierFilterResult FilterBySnooping(const Model& model,
                                     const OutlierFilterOptions& options,
                                     const Context& context) {
  return SnoopingFilter(model, options, context).Run();
}

}  // namespace krot::internal
