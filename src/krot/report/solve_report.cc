#include "krot/report/solve_report.h"

#include <algorithm>
#include <cmath>

#include "krot/base/numbers.h"
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
  switch (method) {
    case SolveMethod::kResInt:
      return "res_int";
    case SolveMethod::kJoint:
      return "joint";
    case SolveMethod::kAuto:
      break;
  }
  return "auto";
}

std::string NormName(Norm norm) {
  if (std::isinf(norm.p)) return "inf";
  std::string text;
  AppendNumber(norm.p, &text);
  return text;
}

}  // namespace krot::internal
