#include "krot/report/adjustment_report.h"

#include <cmath>
#include <optional>
#include <sstream>
#include <vector>

#include <nlohmann/json.hpp>

#include "krot/report/text_table.h"

namespace krot {
namespace {

using Json = nlohmann::ordered_json;

Json NumberOrNull(const std::optional<double>& value) {
  return value ? Json(*value) : Json();
}

Json ErrorJson(const PixelErrorStatistics& statistics) {
  const auto number = [&](double value) {
    return statistics.count > 0 ? Json(value) : Json();
  };
  return {{"max", number(statistics.max)},
          {"p99", number(statistics.p99)},
          {"mean", number(statistics.mean)},
          {"rms", number(statistics.rms)}};
}

Json IterationsJson(const std::vector<BundleAdjustmentIteration>& iterations) {
  Json array = Json::array();
  for (const BundleAdjustmentIteration& iteration : iterations) {
    array.push_back({{"cost", iteration.cost},
                     {"is_successful", iteration.is_successful},
                     {"barrier", NumberOrNull(iteration.barrier)},
                     {"seconds", iteration.seconds}});
  }
  return array;
}

std::string ErrorTable(const AdjustModelSummary& summary) {
  TextTable table;
  const bool has_start = summary.start.has_value();
  const auto add = [&](const char* name, double PixelErrorStatistics::*error) {
    std::vector<std::string> row = {
        name, FormatNumber(summary.pixel_error_before.*error, 4)};
    if (has_start) {
      row.push_back(FormatNumber(summary.pixel_error_start.*error, 4));
    }
    row.push_back(FormatNumber(summary.pixel_error_after.*error, 4));
    table.AddRow(row);
  };
  if (has_start) {
    table.AddRow({"pixels", "before", "start", "after"});
  } else {
    table.AddRow({"pixels", "before", "after"});
  }
  add("max error", &PixelErrorStatistics::max);
  add("P99 error", &PixelErrorStatistics::p99);
  add("mean error", &PixelErrorStatistics::mean);
  add("RMS error", &PixelErrorStatistics::rms);
  return table.ToString();
}

std::string LeftOutList(const BundleAdjustmentSummary& summary) {
  std::string list;
  const auto add = [&](const char* reason, int64_t count) {
    if (count == 0) return;
    list += (list.empty() ? " (" : ", ") + std::string(reason) + " " +
            std::to_string(count);
  };
  add("no_pose", summary.num_no_pose);
  add("behind", summary.num_behind);
  add("short_track", summary.num_short_track);
  return list.empty() ? list : list + ")";
}

int64_t NumLeftOut(const BundleAdjustmentSummary& summary) {
  return summary.num_no_pose + summary.num_behind + summary.num_short_track;
}

std::string CountsSentence(const BundleAdjustmentSummary& summary) {
  return Counted(summary.num_frames, "frame") + ", " +
         Counted(summary.num_images, "image") + ", " +
         Counted(summary.num_points, "point") + ", " +
         Counted(summary.num_observations, "observation") + " and " +
         Counted(summary.num_parameters, "parameter") + " in the adjustment; " +
         Counted(NumLeftOut(summary), "observation") + " left out" +
         LeftOutList(summary) + ".";
}

std::string TerminationSentence(const BundleAdjustmentSummary& summary) {
  const std::string after =
      " after " + Counted(summary.num_iterations, "iteration");
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

// What the cap did, and how good the end is.
std::string CapSentence(const AdjustModelSummary& summary) {
  const BundleAdjustmentSummary& adjustment = summary.adjustment;
  std::ostringstream text;
  text << "Every error of the adjustment is below the cap of "
       << FormatNumber(*summary.max_error, 4) << " px, which holds "
       << Counted(adjustment.num_active, "observation") << ".";
  if (adjustment.duality_gap) {
    text << " Duality gap " << Scientific(*adjustment.duality_gap)
         << " of the cost.";
  }
  return text.str();
}

}  // namespace

std::string AdjustmentTerminationName(BundleAdjustmentTermination termination) {
  switch (termination) {
    case BundleAdjustmentTermination::kNothingToAdjust:
      return "nothing_to_adjust";
    case BundleAdjustmentTermination::kConverged:
      return "converged";
    case BundleAdjustmentTermination::kCapConverged:
      return "cap_converged";
    case BundleAdjustmentTermination::kMaxIterations:
      return "max_iterations";
    case BundleAdjustmentTermination::kStalled:
      return "stalled";
    case BundleAdjustmentTermination::kInfeasibleStart:
      return "infeasible_start";
    case BundleAdjustmentTermination::kInterrupted:
      return "interrupted";
    case BundleAdjustmentTermination::kNotRun:
      break;
  }
  return "not_run";
}

std::string NothingToAdjustSentence(const BundleAdjustmentSummary& summary) {
  if (summary.num_observations > 0) {
    return "nothing to adjust: everything is held still";
  }
  if (NumLeftOut(summary) == 0) {
    return "nothing to adjust: the model has no observations";
  }
  return "nothing to adjust: " + Counted(NumLeftOut(summary), "observation") +
         " left out" + LeftOutList(summary);
}

std::string NoModelBelowCapSentence(const AdjustModelSummary& summary) {
  std::ostringstream text;
  text << "no model with every error below " << *summary.max_error
       << " px was found";
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
         << std::floor(*summary.start->lower_bound * 1e6) / 1e6
         << " px (linearised)";
  }
  return text.str();
}

std::string AdjustmentTable(const AdjustmentReport& report) {
  const AdjustModelSummary& summary = report.summary;
  const BundleAdjustmentSummary& adjustment = summary.adjustment;
  std::ostringstream text;
  text << "\nReprojection errors\n" << ErrorTable(summary);
  if (summary.pixel_error_after.not_finite > 0) {
    text << Counted(summary.pixel_error_after.not_finite, "observation")
         << " without a finite error (behind the camera, no pose, or not "
            "projectable), in no row above.\n";
  }
  text << CountsSentence(adjustment) << '\n'
       << TerminationSentence(adjustment) << " Cost "
       << FormatNumber(adjustment.cost_initial, 3) << " -> "
       << FormatNumber(adjustment.cost_final, 3)
       << " px^2 (half the sum of the squared errors, robust if a loss is)";
  if (adjustment.stationarity) {
    text << ", stationarity " << Scientific(*adjustment.stationarity);
  }
  text << ".\n";
  if (summary.max_error) text << CapSentence(summary) << '\n';
  text << "Read " << FormatNumber(report.seconds_read, 2) << " s, ";
  if (summary.start) {
    text << "found a start in "
         << FormatNumber(
                summary.start->seconds_build + summary.start->seconds_solve, 2)
         << " s, ";
  }
  text << "adjusted " << FormatNumber(adjustment.seconds, 2) << " s, wrote "
       << FormatNumber(report.seconds_write, 2) << " s; "
       << FormatNumber(report.seconds_total, 2) << " s in all on "
       << Counted(report.threads, "thread") << ", "
       << FormatBytes(report.peak_memory_bytes) << " at most.\n";
  return text.str();
}

std::string AdjustmentJson(const AdjustmentReport& report) {
  const AdjustModelSummary& summary = report.summary;
  const BundleAdjustmentSummary& adjustment = summary.adjustment;
  Json start_bound, start_seconds;  // null unless there was such a solve
  if (summary.start) {
    start_bound = NumberOrNull(summary.start->lower_bound);
    start_seconds = summary.start->seconds_build + summary.start->seconds_solve;
  }
  const Json json = {
      {"version", report.version},
      {"command", "bundle_adjuster"},
      {"termination", AdjustmentTerminationName(adjustment.termination)},
      {"num_frames", adjustment.num_frames},
      {"num_images", adjustment.num_images},
      {"num_points", adjustment.num_points},
      {"num_observations", adjustment.num_observations},
      {"num_parameters", adjustment.num_parameters},
      {"left_out",
       {{"no_pose", adjustment.num_no_pose},
        {"behind", adjustment.num_behind},
        {"short_track", adjustment.num_short_track}}},
      {"cost_initial", adjustment.cost_initial},
      {"cost_final", adjustment.cost_final},
      {"num_iterations", adjustment.num_iterations},
      {"iterations", IterationsJson(adjustment.iterations)},
      {"linear_solver", adjustment.linear_solver},
      {"stationarity", NumberOrNull(adjustment.stationarity)},
      {"max_error", NumberOrNull(summary.max_error)},
      {"duality_gap", NumberOrNull(adjustment.duality_gap)},
      {"num_active", adjustment.num_active},
      {"start_lower_bound", start_bound},
      {"pixel_error",
       {{"before", ErrorJson(summary.pixel_error_before)},
        {"start", ErrorJson(summary.pixel_error_start)},
        {"after", ErrorJson(summary.pixel_error_after)}}},
      {"seconds",
       {{"read", report.seconds_read},
        {"start", start_seconds},
        {"adjust", adjustment.seconds},
        {"write", report.seconds_write},
        {"total", report.seconds_total}}},
      {"peak_memory_bytes", report.peak_memory_bytes},
      {"threads", report.threads},
      {"seed", report.seed},
  };
  return json.dump(2) + "\n";
}

}  // namespace krot
