#include "krot/report/solve_report.h"

#include <algorithm>
#include <cmath>

#include "krot/base/number_text.h"
#include "krot/report/text_table.h"

namespace krot {

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
              ? "; the gap is " + Scientific(*summary.relative_gap)
          : summary.lower_bound ? "; there is no finite maximum"
                                : "; no bound is proved");
}

std::optional<double> LinearRelativeGap(const SolveSummary& summary) {
  if (summary.rounds.empty()) return std::nullopt;
  const Round& last = summary.rounds.back();
  if (!last.linear_lower_bound || !(last.linear_cost > 0)) return std::nullopt;
  return (last.linear_cost - *last.linear_lower_bound) / last.linear_cost;
}

std::string GivenBackSentence(const SolveSummary& summary) {
  return summary.polish
             ? "No better estimate was found: the polish began at the model as "
               "it was read."
             : "No better estimate was found: the model is written as it was "
               "read.";
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

}  // namespace krot
