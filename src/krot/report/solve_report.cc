#include <algorithm>
#include <cmath>
#include <optional>

#include "krot/base/numbers.h"
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
    if (o.has_image_twice &&
        std::find(points.begin(), points.end(), o.point3D_id) == points.end()) {
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

Json JointIterationJson(const JointIteration& iteration) {
  return Joined(
      {{"method", iteration.target ? "feasible_start" : "joint"}},
      KROT_JSON_OF(iteration, cost, lower_bound, gap, target, seconds));
}

Json RoundJson(const Round& round) {
  return KROT_JSON_OF(round, linear_cost, linear_lower_bound, step, cost,
                      lower_bound, seconds);
}

Json SweepJson(const Sweep& sweep) {
  return KROT_JSON_OF(sweep, cost, seconds);
}

Json SupportObservationJson(const SupportObservation& observation) {
  return ObservationJson(observation,
                         KROT_JSON_OF(observation, multiplier, error_px));
}

Json FoldJson(const FoldObservation& fold) {
  return KROT_JSON_OF(fold, image_id, image_name, point2D_idx, camera_id);
}

Json FactorJson(const PositionFactor& factor) {
  return Joined({{"value", factor.factor}},
                KROT_JSON_OF(factor, lower_bound, max_error));
}

Json PositionJson(const SupportPosition& position) {
  return Joined(position.image_name.empty()
                    ? KROT_JSON_OF(position, point3D_id)
                    : KROT_JSON_OF(position, image_id, image_name),
                KROT_JSON_OF(position, share, distance, radius));
}

Json PolishJson(const PolishSummary& polish) {
  const BundleAdjustmentSummary& adjustment = polish.adjustment;
  Json json = {
      {"polish", PolishName(polish.polish)},
      {"termination", AdjustmentTerminationName(adjustment.termination)}};
  json.update(
      KROT_JSON_OF(adjustment, cost_initial, cost_final, num_iterations));
  json["pixel_error"] = ErrorJson(polish.pixel_error);
  json["seconds"] = adjustment.seconds;
  return json;
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

Json FinishJson(const FinishSummary& finish) {
  const BoundedSummary& solve = finish.solve;
  Json json = {{"finish", FinishName(Finish::kLeastSquares)},
               {"loss", LossName(finish.loss.kind)},
               {"termination", FinishTerminationName(solve.termination)}};
  json.update(KROT_JSON_OF(finish, cap, lowest_cost));
  json.update(KROT_JSON_OF(solve, cost_initial, cost_final, duality_gap,
                           stationarity, num_active));
  json["num_iterations"] = solve.iterations;
  json["seconds"] = finish.seconds;
  return json;
}

Json OutliersJson(const OutlierFilterSummary& outliers) {
  return Joined(
      Joined({{"max_error", outliers.max_error}}, OutlierCountsJson(outliers)),
      {{"is_search_complete", outliers.is_search_complete},
       {"weak_parts", WeakPartsJson(outliers)},
       {"one_centre_turn_deg", outliers.one_centre_turn_deg},
       {"seconds",
        {{"removal", outliers.seconds_removal},
         {"conflicts", outliers.seconds_conflicts},
         {"solve", outliers.seconds_solve}}}});
}

}  // namespace

std::string SolveJson(const SolveReport& report) {
  const SolveSummary& summary = report.summary;
  std::optional<double> linear_cost, linear_lower_bound;  // of the last round
  if (!summary.rounds.empty()) {
    linear_cost = summary.rounds.back().linear_cost;
    linear_lower_bound = summary.rounds.back().linear_lower_bound;
  }
  Json json = {{"version", report.run.version},
               {"command", report.command},
               {"method", report.method},
               {"norm", NormName(summary.norm)},
               {"termination", TerminationName(summary.termination)}};
  json.update(KROT_JSON_OF(summary, num_frames, num_images, num_points,
                           num_observations));
  json["working_observations"] = summary.num_working_observations;
  json["left_out"] = LeftOutJson(LeftOutByReason(summary));
  json["same_image"] = {{"num_tracks", summary.num_same_image_tracks},
                        {"support_point3D_ids", SameImageInSupport(summary)},
                        {"largest_left_out", LargestTwin(summary)}};
  json["outliers"] = JsonIf(report.outliers, OutliersJson);
  json["matches"] = JsonIf(report.matches, MatchesJson);
  json["rotations"] = JsonIf(report.run.rotations, RotationsJson);
  json["fixed"] = {{"num_frames", summary.num_fixed_frames},
                   {"num_points", summary.num_fixed_points}};
  json["positions"] = {
      {"num_known", summary.num_positions},
      {"largest_ratio", summary.largest_position_ratio},
      {"frame",
       PositionFrameJson(report.position_frame, report.is_in_position_frame)},
      {"factor", JsonIf(summary.position_factor, FactorJson)}};
  json["distances"] = DistancesJson(report.distances, {"before", "after"});
  json["not_held"] = NotHeldJson(summary.loose);
  json.update(KROT_JSON_OF(summary, cost_initial, cost_final, lower_bound,
                           relative_gap));
  json["linear_cost"] = linear_cost;
  json["linear_lower_bound"] = linear_lower_bound;
  json["linear_relative_gap"] = LinearRelativeGap(summary);
  json["certified"] = summary.is_certified;
  json["is_given_back"] = summary.is_given_back;
  json["verdict"] = VerdictSentence(summary);
  json["collapse"] =
      KROT_JSON_OF(summary.collapse, in_camera, at_infinity, is_in_one_place);
  json["is_underdetermined"] = summary.is_underdetermined;
  json["pixel_error"] =
      BeforeAfterJson(summary.pixel_error_before, summary.pixel_error_after);
  json["finish"] = JsonIf(summary.finish, FinishJson);
  json["polish"] = JsonIf(summary.polish, PolishJson);
  json["rounds"] = ListJson(summary.rounds, RoundJson);
  json["sweeps"] = ListJson(summary.sweeps, SweepJson);
  json["iterations"] = ListJson(summary.iterations, JointIterationJson);
  json["support"] = ListJson(summary.support, SupportObservationJson);
  json["support_positions"] = ListJson(summary.support_positions, PositionJson);
  json["at_folds"] = ListJson(summary.at_folds, FoldJson);
  json["announced_memory_bytes"] = summary.needed_bytes;
  return ReportText(json, report.run,
                    {{"build", summary.seconds_build},
                     {"solve", summary.seconds_solve},
                     {"certify", summary.seconds_certify}});
}

}  // namespace krot::internal
