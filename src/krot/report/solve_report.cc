#include <algorithm>
#include <cmath>
#include <optional>

#include "krot/base/numbers.h"
#include "krot/report/pair_report.h"
#include "krot/report/report_json.h"
#include "krot/report/reports.h"
#include "krot/report/text_table.h"

namespace krot::internal {

LeftOutCounts LeftOutByReason(const SolveSummary& summary) {
  LeftOutCounts counts;
  for (int reason = 0; reason < kNumLeftOutReasons; ++reason) {
    counts.emplace_back(LeftOutName(static_cast<LeftOut>(reason)),
                        summary.left_out[reason]);
  }
  return counts;
}

std::string NothingToSolveSentence(const SolveSummary& summary) {
  return NothingToDoSentence("solve", LeftOutByReason(summary));
}

std::vector<Point3DId> SameImageInSupport(const SolveSummary& summary) {
  std::vector<Point3DId> points;
  for (const SupportObservation& o : summary.support) {
    if (!o.has_image_twice) continue;
    if (std::find(points.begin(), points.end(), o.point3D_id) == points.end()) {
      points.push_back(o.point3D_id);
    }
  }
  return points;
}

std::string MissedGapSentence(const SolveSummary& summary) {
  const std::string why =
      summary.termination == SolveTermination::kMaxIterations
          ? "Joint.max_iterations was hit"
          : "no further progress was made";
  return "the gap asked for is not reached: " + why +
         (summary.relative_gap
              ? "; the maximum is " + GapWords(*summary.relative_gap)
          : summary.lower_bound ? "; there is no finite maximum"
                                : "; no bound is proved");
}

std::optional<double> LinearRelativeGap(const SolveSummary& summary) {
  if (summary.rounds.empty()) return std::nullopt;
  const Round& last = summary.rounds.back();
  if (!last.linear_lower_bound || !(last.linear_cost > 0)) return std::nullopt;
  return (last.linear_cost - *last.linear_lower_bound) / last.linear_cost;
}

bool CostIsMaximum(const SolveSummary& summary) {
  return summary.norm.p == 2 &&
         FormatNumber(summary.cost_final, 4) ==
             FormatNumber(summary.pixel_error_after.max, 4);
}

std::string GapPercent(double relative_gap) {
  const double percent = 100 * relative_gap;
  return (percent < 1e-4 ? std::string("less than 0.0001")
                         : FormatNumber(percent, 4)) +
         " %";
}

std::string GapWords(double relative_gap) {
  return "proved to be within " + GapPercent(relative_gap) + " of the lowest";
}

std::string UnderdeterminedWords(const SolveSummary& summary) {
  return Counted(summary.num_observations, "observation") +
         " are too few to determine " + Counted(summary.num_frames, "frame") +
         " and " + Counted(summary.num_points, "point");
}

std::string GivenBackSentence(const SolveSummary& summary) {
  const std::string what = summary.polish
                               ? "the polish began at the model as it was read."
                               : "the model is written as it was read.";
  if (summary.collapse.IsWhole()) {
    return "No estimate is of use: " + WholeCollapseWords(summary.collapse) +
           "; " + what +
           " Most likely the observations name the wrong 2D points.";
  }
  if (summary.worse_images_side) {
    return "No better estimate was found: " +
           WorseImagesWords(*summary.worse_images_side) + "; " + what +
           " --Model.on_contradiction auto solves the side that fits, and "
           "writes a model that agrees with itself.";
  }
  return "No better estimate was found: " + what;
}

std::string MethodName(SolveMethod method) {
  using Enum = SolveMethod;
  return NameIn<Enum>({{Enum::kAuto, "auto"},
                       {Enum::kResInt, "res_int"},
                       {Enum::kJoint, "joint"}},
                      method);
}

std::string NormName(Norm norm) {
  if (std::isinf(norm.p)) return "inf";
  std::string text;
  AppendNumber(norm.p, &text);
  return text;
}

namespace {

const char* TerminationName(SolveTermination termination) {
  using Enum = SolveTermination;
  return NameIn<Enum>({{Enum::kNotRun, "not_run"},
                       {Enum::kGapReached, "gap_reached"},
                       {Enum::kZeroCost, "zero_cost"},
                       {Enum::kStalled, "stalled"},
                       {Enum::kUnproved, "unproved"},
                       {Enum::kMaxSweeps, "max_sweeps"},
                       {Enum::kMaxIterations, "max_iterations"},
                       {Enum::kInfeasible, "infeasible"},
                       {Enum::kNoStart, "no_start"},
                       {Enum::kInterrupted, "interrupted"},
                       {Enum::kNothingToSolve, "nothing_to_solve"},
                       {Enum::kWithinBound, "within_bound"},
                       {Enum::kCollapsed, "collapsed"}},
                      termination);
}

// The largest error of observations that were left out because their track has
// a closer one of the same image.
std::optional<double> LargestTwin(const SolveSummary& summary) {
  const int64_t count =
      summary.left_out[static_cast<size_t>(LeftOut::kSameImage)];
  if (count == 0 || !std::isfinite(summary.largest_twin_error)) return {};
  return summary.largest_twin_error;
}

Json JointIterationsJson(const std::vector<JointIteration>& iterations) {
  return ListJson(iterations, [&](const JointIteration& iteration) -> Json {
    return {{"method", iteration.target ? "feasible_start" : "joint"},
            {"cost", NumberOrNull(iteration.cost)},
            {"lower_bound", NumberOrNull(iteration.lower_bound)},
            {"gap", NumberOrNull(iteration.gap)},
            {"target", NumberOrNull(iteration.target)},
            {"seconds", iteration.seconds}};
  });
}

Json RoundsJson(const std::vector<Round>& rounds) {
  return ListJson(rounds, [&](const Round& round) -> Json {
    return {{"linear_cost", round.linear_cost},
            {"linear_lower_bound", NumberOrNull(round.linear_lower_bound)},
            {"step", round.step},
            {"cost", round.cost},
            {"lower_bound", NumberOrNull(round.lower_bound)},
            {"seconds", round.seconds}};
  });
}

Json SupportJson(const std::vector<SupportObservation>& support) {
  return ListJson(support, [&](const SupportObservation& observation) -> Json {
    return ObservationJson(observation, {{"multiplier", observation.multiplier},
                                         {"error_px", observation.error_px}});
  });
}

Json FoldsJson(const std::vector<FoldObservation>& folds) {
  return ListJson(folds, [&](const FoldObservation& observation) -> Json {
    return {{"image_id", observation.image_id},
            {"image_name", observation.image_name},
            {"point2D_idx", observation.point2D_idx},
            {"camera_id", observation.camera_id}};
  });
}

Json FactorJson(const std::optional<PositionFactor>& factor) {
  if (!factor) return nullptr;
  return {{"value", factor->factor},
          {"lower_bound", factor->lower_bound},
          {"max_error", factor->max_error}};
}

Json PositionsJson(const std::vector<SupportPosition>& positions) {
  return ListJson(positions, [&](const SupportPosition& position) -> Json {
    Json entry = position.image_name.empty()
                     ? Json({{"point3D_id", position.point3D_id}})
                     : Json({{"image_id", position.image_id},
                             {"image_name", position.image_name}});
    entry.update({{"share", position.share},
                  {"distance", position.distance},
                  {"radius", position.radius}});
    return entry;
  });
}

Json PolishJson(const std::optional<PolishSummary>& polish) {
  if (!polish) return {};
  const BundleAdjustmentSummary& adjustment = polish->adjustment;
  return {{"polish", PolishName(polish->polish)},
          {"termination", AdjustmentTerminationName(adjustment.termination)},
          {"cost_initial", adjustment.cost_initial},
          {"cost_final", adjustment.cost_final},
          {"num_iterations", adjustment.num_iterations},
          {"pixel_error", ErrorJson(polish->pixel_error)},
          {"seconds", adjustment.seconds}};
}

const char* FinishTerminationName(InteriorPointTermination termination) {
  using Enum = InteriorPointTermination;
  return NameIn<Enum>({{Enum::kNotRun, "not_run"},
                       {Enum::kConverged, "converged"},
                       {Enum::kMaxIterations, "max_iterations"},
                       {Enum::kNoProgress, "no_progress"},
                       {Enum::kSingular, "singular"},
                       {Enum::kInterrupted, "interrupted"}},
                      termination);
}

Json FinishJson(const std::optional<FinishSummary>& finish) {
  if (!finish) return {};
  const BoundedSummary& solve = finish->solve;
  return {{"finish", FinishName(Finish::kLeastSquares)},
          {"loss", LossName(finish->loss.kind)},
          {"termination", FinishTerminationName(solve.termination)},
          {"cap", finish->cap},
          {"lowest_cost", finish->lowest_cost},
          {"cost_initial", solve.cost_initial},
          {"cost_final", solve.cost_final},
          {"duality_gap", NumberOrNull(solve.duality_gap)},
          {"stationarity", NumberOrNull(solve.stationarity)},
          {"num_active", solve.num_active},
          {"num_iterations", solve.iterations},
          {"seconds", finish->seconds}};
}

Json OutliersJson(const std::optional<OutlierFilterSummary>& outliers) {
  if (!outliers) return {};
  return {{"max_error", outliers->max_error},
          {"is_within", outliers->is_within},
          {"num_observations", outliers->num_observations},
          {"num_points", outliers->num_points},
          {"num_removed", outliers->removed.size()},
          {"num_left_alone", outliers->num_left_alone},
          {"num_points_removed", outliers->num_points_removed},
          {"num_must_go",
           outliers->conflicts ? Json(outliers->num_proved) : Json()},
          {"is_search_complete", outliers->is_search_complete},
          {"weak_parts", WeakPartsJson(*outliers)},
          {"seconds",
           {{"removal", outliers->seconds_removal},
            {"conflicts", outliers->seconds_conflicts},
            {"solve", outliers->seconds_solve}}}};
}

}  // namespace

std::string SolveJson(const SolveReport& report) {
  const SolveSummary& summary = report.summary;
  const Json left_out = LeftOutJson(LeftOutByReason(summary));
  Json sweeps = ListJson(summary.sweeps, [&](const Sweep& sweep) -> Json {
    return {{"cost", sweep.cost}, {"seconds", sweep.seconds}};
  });
  std::optional<double> linear_cost, linear_lower_bound;  // of the last round
  if (!summary.rounds.empty()) {
    linear_cost = summary.rounds.back().linear_cost;
    linear_lower_bound = summary.rounds.back().linear_lower_bound;
  }
  const Json json = {
      {"version", report.run.version},
      {"command", report.command},
      {"method", report.method},
      {"norm", NormName(summary.norm)},
      {"termination", TerminationName(summary.termination)},
      {"num_frames", summary.num_frames},
      {"num_images", summary.num_images},
      {"num_points", summary.num_points},
      {"num_observations", summary.num_observations},
      {"working_observations", NumberOrNull(summary.num_working_observations)},
      {"left_out", left_out},
      {"same_image",
       {{"num_tracks", summary.num_same_image_tracks},
        {"support_point3D_ids", SameImageInSupport(summary)},
        {"largest_left_out", NumberOrNull(LargestTwin(summary))}}},
      {"outliers", OutliersJson(report.outliers)},
      {"matches", report.matches ? MatchesJson(*report.matches) : Json()},
      {"rotations", RotationsJson(report.run.rotations)},
      {"fixed",
       {{"num_frames", summary.num_fixed_frames},
        {"num_points", summary.num_fixed_points}}},
      {"positions",
       {{"num_known", summary.num_positions},
        {"largest_ratio", summary.largest_position_ratio},
        {"frame",
         PositionFrameJson(report.position_frame, report.is_in_position_frame)},
        {"factor", FactorJson(summary.position_factor)}}},
      {"distances", DistancesJson(report.distances, {"before", "after"})},
      {"not_held", NotHeldJson(summary.loose)},
      {"cost_initial", summary.cost_initial},
      {"cost_final", summary.cost_final},
      {"lower_bound", NumberOrNull(summary.lower_bound)},
      {"relative_gap", NumberOrNull(summary.relative_gap)},
      {"linear_cost", NumberOrNull(linear_cost)},
      {"linear_lower_bound", NumberOrNull(linear_lower_bound)},
      {"linear_relative_gap", NumberOrNull(LinearRelativeGap(summary))},
      {"certified", summary.is_certified},
      {"is_given_back", summary.is_given_back},
      {"verdict", VerdictSentence(summary)},
      {"collapse",
       {{"in_camera", summary.collapse.in_camera},
        {"at_infinity", summary.collapse.at_infinity},
        {"is_in_one_place", summary.collapse.is_in_one_place}}},
      {"is_underdetermined", summary.is_underdetermined},
      {"pixel_error",
       {{"before", ErrorJson(summary.pixel_error_before)},
        {"after", ErrorJson(summary.pixel_error_after)}}},
      {"finish", FinishJson(summary.finish)},
      {"polish", PolishJson(summary.polish)},
      {"rounds", RoundsJson(summary.rounds)},
      {"sweeps", sweeps},
      {"iterations", JointIterationsJson(summary.iterations)},
      {"support", SupportJson(summary.support)},
      {"support_positions", PositionsJson(summary.support_positions)},
      {"at_folds", FoldsJson(summary.at_folds)},
      {"announced_memory_bytes", summary.needed_bytes},
  };
  return ReportText(json, report.run,
                    {{"build", summary.seconds_build},
                     {"solve", summary.seconds_solve},
                     {"certify", NumberOrNull(summary.seconds_certify)}});
}

}  // namespace krot::internal
