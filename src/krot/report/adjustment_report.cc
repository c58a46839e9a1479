#include "krot/report/reports.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/report/report_json.h"
#include "krot/report/sentences.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

Json AdjustmentIterationJson(const BundleAdjustmentIteration& iteration) {
  return KROT_JSON_OF(iteration, cost, is_successful, barrier, cap, seconds);
}

std::string AdjustmentErrorTable(const AdjustModelSummary& summary) {
  Row head = {"pixels", "before"};
  std::vector<PixelErrorStatistics> estimates = {summary.pixel_error_before};
  if (summary.start) {
    head.push_back("start");
    estimates.push_back(summary.pixel_error_start);
  }
  head.push_back("after");
  estimates.push_back(summary.pixel_error_after);
  TextTable table(head);
  AddErrorColumns(estimates, &table);
  return table.ToString();
}

LeftOutCounts LeftOutBy(const BundleAdjustmentSummary& summary) {
  return {{"no_pose", summary.num_no_pose},
          {"behind", summary.num_behind},
          {"short_track", summary.num_short_track}};
}

std::string AdjustmentCountsSentence(const BundleAdjustmentSummary& summary) {
  return CountsWords(summary) + " and " +
         Counted(summary.num_parameters, "parameter") + " in the adjustment; " +
         LeftOutWords(LeftOutBy(summary)) + ".";
}

std::string AdjustmentEndSentence(const BundleAdjustmentSummary& summary) {
  std::string after = " after " + Counted(summary.num_iterations, "iteration");
  if (summary.first_loss_scale) {
    after += ", the first of them with a loss scale of " +
             Pixels(*summary.first_loss_scale, 2) +
             ", the median error of the start";
  }
  if (summary.num_moved_frames > 0) {
    after += ", between which " +
             Counted(summary.num_moved_frames, "frame", "was", "were") +
             " moved alone";
  }
  switch (summary.termination) {
    case BundleAdjustmentTermination::kConverged:
      return "Converged" + after + ".";
    case BundleAdjustmentTermination::kCapConverged:
      return "Ended" + after +
             ", duality gap and stationarity within their tolerances.";
    case BundleAdjustmentTermination::kMaxIterations:
      return "Ended" + after + ", as many as were allowed.";
    case BundleAdjustmentTermination::kStalled:
      return "Stalled" + after + ": no further progress was made.";
    case BundleAdjustmentTermination::kInterrupted:
      return "Interrupted" + after + ".";
    case BundleAdjustmentTermination::kInfeasibleStart:
    case BundleAdjustmentTermination::kNothingToAdjust:
    case BundleAdjustmentTermination::kNotRun:
      break;
  }
  return "Not run.";
}

// The time of the solve for a model below the cap.
double StartSeconds(const SolveSummary& start) {
  return start.seconds_build + start.seconds_solve;
}

// Says what the cap did, and how good the result is.
std::string CapSentence(const AdjustModelSummary& summary) {
  const BundleAdjustmentSummary& adjustment = summary.adjustment;
  std::ostringstream text;
  if (adjustment.lowest_max_error) {
    text << "The lowest maximum found with all that moves is "
         << FormatNumber(*adjustment.lowest_max_error, 4)
         << (adjustment.is_lowest_max_error_converged
                 ? " px: a local minimum, nearly, of which no bound is proved. "
                 : " px, but the search for it ended early, so a lower one may "
                   "well exist. ");
  }
  text << "Every error of the adjustment is below the cap of "
       << FormatNumber(*summary.max_error, 4) << " px";
  // Before the end of the path every observation has a multiplier.
  if (adjustment.termination == BundleAdjustmentTermination::kCapConverged) {
    text << ", which holds " << Counted(adjustment.num_active, "observation");
  }
  text << ".";
  if (adjustment.duality_gap) {
    text << " Duality gap " << Scientific(*adjustment.duality_gap)
         << " of the cost.";
  }
  return text.str();
}

Json KnownPositionsJson(const AdjustmentReport& report) {
  Json json = SurveyJson(report.positions, false);
  if (json.is_null()) return json;
  json["sigma_px"] = report.summary.adjustment.sigma_px;
  json["frame"] =
      PositionFrameJson(report.position_frame, report.is_in_position_frame);
  return json;
}

// Says how well the known positions fit, where some are given.
std::string KnownPositionsSentence(const AdjustmentReport& report) {
  const BundleAdjustmentSummary& summary = report.summary.adjustment;
  if (summary.num_positions == 0) {
    return "No known position took part: nothing that they are of moves.";
  }
  const auto farthest = std::max_element(
      report.positions->places.begin(), report.positions->places.end(),
      [](const auto& a, const auto& b) { return a.deviations < b.deviations; });
  return Counted(summary.num_positions, "known position") +
         " took part, beside noise of " +
         Pixels(summary.sigma_px.value_or(1), 3) + " per axis: the model is " +
         FormatLength(report.positions->rms) +
         " off (RMS, in the positions' unit), farthest " + farthest->name +
         ", by " + FormatNumber(farthest->deviations, 1) +
         " standard deviations.";
}

// By how far the parameter's standard deviation moves a corner of the image,
// relative to the corner's distance from the principal point: the most of all
// corners.
double CornerShift(const Camera& camera, int param, double sigma) {
  const int num_focal = FindCameraModel(camera.model_id)->num_focal_lengths();
  const Eigen::Vector2d center(camera.params[num_focal],
                               camera.params[num_focal + 1]);
  Camera moved = camera;
  const double step = 1e-6 * std::max(1.0, std::abs(camera.params[param]));
  moved.params[param] += step;
  double most = 0;
  for (const int corner : {0, 1, 2, 3}) {
    const Eigen::Vector2d pixel(
        static_cast<double>(corner % 2 == 0 ? 0 : camera.width),
        static_cast<double>(corner / 2 == 0 ? 0 : camera.height));
    const auto undistorted = UndistortPixel(camera, pixel);
    // Beyond the fold of a lens, as without distortion.
    const Eigen::Vector2d u =
        undistorted ? undistorted->u
                    : Eigen::Vector2d((pixel - center) / camera.params[0]);
    const double shift_px =
        sigma * (ProjectRay(moved, u) - ProjectRay(camera, u)).norm() / step;
    if (std::isfinite(shift_px)) {
      most = std::max(most, shift_px / (pixel - center).norm());
    }
  }
  return most;
}

std::string HoldWords(const Camera& camera, int param) {
  const int num_focal = FindCameraModel(camera.model_id)->num_focal_lengths();
  const char* const group = param < num_focal       ? "focal_length"
                            : param < num_focal + 2 ? "principal_point"
                                                    : "extra_params";
  return "hold it (--BundleAdjustment.refine_" + std::string(group) + " 0)";
}

// About a camera's refined parameter that the observations leave open the most;
// empty if they determine all.
std::string NotDeterminedSentence(const CameraPrecision& precision,
                                  const Camera& camera) {
  const std::string who = "camera " + std::to_string(camera.id) + ": ";
  if (!precision.covariance) {
    return who +
           "the observations do not determine all intrinsics that may "
           "move; hold some (--BundleAdjustment.refine_focal_length 0, "
           "refine_extra_params 0)";
  }
  const Eigen::VectorXd sigmas = Deviations(*precision.covariance);
  double most = 1;
  std::string sentence;
  for (size_t n = 0; n < precision.params.size(); ++n) {
    const int param = precision.params[n];
    const double sigma = sigmas[static_cast<Eigen::Index>(n)];
    const double shift = CornerShift(camera, param, sigma);
    if (!(shift > most)) continue;
    most = shift;
    sentence = who + "the observations do not determine " +
               ParamNames(camera.model_id)[param] + ", which is " +
               FormatLength(camera.params[param]) + " +- " +
               FormatLength(sigma) + "; " + HoldWords(camera, param);
  }
  return sentence;
}

}  // namespace

std::vector<std::string> AdjustmentWarnings(const AdjustmentReport& report,
                                            const Model& model) {
  const BundleAdjustmentSummary& summary = report.summary.adjustment;
  std::vector<std::string> warnings;
  // What is left to gain is more than noise explains. Who allows no iteration
  // wants none.
  const auto redundancy = static_cast<double>(2 * summary.num_observations -
                                              summary.num_parameters);
  if (summary.termination == BundleAdjustmentTermination::kMaxIterations &&
      summary.num_iterations > 0 &&
      summary.stationarity.value_or(0) * redundancy > 1) {
    warnings.push_back(
        "the adjustment ended at the limit of iterations, far from a minimum: "
        "its stationarity is " +
        Scientific(summary.stationarity) +
        "; allow more (--BundleAdjustmentCeres.max_num_iterations)");
  }
  const auto& precision = report.summary.precision;
  if (!precision || !precision->has_covariances) return warnings;
  for (const CameraPrecision& one : precision->cameras) {
    std::string sentence =
        NotDeterminedSentence(one, model.cameras[one.camera]);
    if (!sentence.empty()) warnings.push_back(std::move(sentence));
  }
  return warnings;
}

std::string AdjustmentTerminationName(BundleAdjustmentTermination termination) {
  using Enum = BundleAdjustmentTermination;
  return NameIn<Enum>({{Enum::kNotRun, "not_run"},
                       {Enum::kNothingToAdjust, "nothing_to_adjust"},
                       {Enum::kConverged, "converged"},
                       {Enum::kCapConverged, "cap_converged"},
                       {Enum::kMaxIterations, "max_iterations"},
                       {Enum::kStalled, "stalled"},
                       {Enum::kInfeasibleStart, "infeasible_start"},
                       {Enum::kInterrupted, "interrupted"}},
                      termination);
}

std::string NothingToAdjustSentence(const BundleAdjustmentSummary& summary) {
  if (summary.num_observations > 0) {
    return "nothing to adjust: everything is held still";
  }
  return NothingToDoSentence("adjust", LeftOutBy(summary));
}

std::string NoModelBelowCapSentence(const AdjustModelSummary& summary) {
  std::ostringstream text;
  text << "no model with every error below "
       << summary.max_error.value_or(kInfinity) << " px was found";
  if (!summary.start) return text.str();
  const PixelErrorStatistics& errors = summary.pixel_error_start;
  if (errors.not_finite > 0) {
    text << ": " << Counted(errors.not_finite, "observation")
         << " without a finite error";
    return text.str();
  }
  text << "; with these rotations and cameras the lowest maximum found is "
       << errors.max << " px";
  if (summary.start->lower_bound) {
    text << ", and it is proved that none is below "
         << std::floor(*summary.start->lower_bound * 1e6) / 1e6 << " px";
  }
  return text.str();
}

std::string AdjustmentTable(const AdjustmentReport& report) {
  const AdjustModelSummary& summary = report.summary;
  const BundleAdjustmentSummary& adjustment = summary.adjustment;
  std::ostringstream text;
  text << "\nReprojection errors\n" << AdjustmentErrorTable(summary);
  text << NotFiniteSentence(summary.pixel_error_after)
       << AdjustmentCountsSentence(adjustment) << '\n'
       << AdjustmentEndSentence(adjustment) << " Cost "
       << FormatNumber(adjustment.cost_initial, 3) << " -> "
       << FormatNumber(adjustment.cost_final, 3)
       << " px^2 (half the sum of the squared errors, robust if a loss is)";
  if (adjustment.stationarity) {
    text << ", stationarity " << Scientific(*adjustment.stationarity);
  }
  text << ".\n";
  if (summary.max_error) text << CapSentence(summary) << '\n';
  if (report.positions || (adjustment.sigma_px && !report.distances)) {
    text << KnownPositionsSentence(report) << '\n';
  }
  if (summary.precision) text << PrecisionSentence(*summary.precision) << '\n';
  if (report.distances) text << AdjustedDistanceTable(*report.distances);
  text << LastingFaultLines(report.faults);
  text << RunSentence(
      report.run,
      (summary.start
           ? "found a start in " + Seconds(StartSeconds(*summary.start)) + ", "
           : "") +
          "adjusted " + Seconds(adjustment.seconds));
  return text.str();
}

std::string AdjustmentJson(const AdjustmentReport& report, const Model& model) {
  const AdjustModelSummary& summary = report.summary;
  const BundleAdjustmentSummary& adjustment = summary.adjustment;
  const auto precision_of = [&](const AdjustmentPrecision& precision) {
    return PrecisionJson(precision, model);
  };
  Json json = {
      {"version", report.run.version},
      {"command", "bundle_adjuster"},
      {"termination", AdjustmentTerminationName(adjustment.termination)}};
  json.update(KROT_JSON_OF(adjustment, num_frames, num_images, num_points,
                           num_observations, num_parameters));
  json["left_out"] = LeftOutJson(LeftOutBy(adjustment));
  json.update(
      KROT_JSON_OF(adjustment, cost_initial, cost_final, num_iterations));
  json["iterations"] = ListJson(adjustment.iterations, AdjustmentIterationJson);
  json.update(KROT_JSON_OF(adjustment, num_moved_frames, first_loss_scale,
                           linear_solver, stationarity));
  json["max_error"] = summary.max_error;
  json["lowest_max_error"] = adjustment.lowest_max_error;
  json.update(KnownIf(adjustment.lowest_max_error.has_value(),
                      KROT_JSON_OF(adjustment, is_lowest_max_error_converged)));
  json.update(KROT_JSON_OF(adjustment, duality_gap, num_active));
  // Null unless there was a solve below the cap.
  json["start_lower_bound"] =
      summary.start ? summary.start->lower_bound : std::nullopt;
  json["pixel_error"] = {{"before", ErrorJson(summary.pixel_error_before)},
                         {"start", ErrorJson(summary.pixel_error_start)},
                         {"after", ErrorJson(summary.pixel_error_after)}};
  json["precision"] = JsonIf(summary.precision, precision_of);
  json["warnings"] = AdjustmentWarnings(report, model);
  json["check_points"] = SurveyJson(report.check_points, true);
  json["positions"] = KnownPositionsJson(report);
  json["distances"] = AdjustedDistancesJson(report.distances);
  json.update(KROT_JSON_OF(report.faults, num_in_camera, num_parts));
  return ReportText(json, report.run,
                    {{"start", JsonIf(summary.start, StartSeconds)},
                     {"adjust", adjustment.seconds}});
}

}  // namespace krot::internal
