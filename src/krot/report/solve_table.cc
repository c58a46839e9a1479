#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>

#include "krot/problem/cost.h"
#include "krot/report/certificate_table.h"
#include "krot/report/solve_error_table.h"
#include "krot/report/solve_report.h"
#include "krot/report/text_table.h"

namespace krot {
namespace {

// How many observations of the support the terminal shows.
constexpr int kListedSupport = 10;

// What is proved, and what is not.
std::string Verdict(const SolveSummary& summary) {
  const std::string maximum =
      "Maximum " + FormatNumber(summary.cost_final, 4) + " px (linearised)";
  if (IsZeroUpToRounding(summary.cost_final)) {
    return "Every error is zero up to rounding (" +
           Scientific(summary.cost_final) + " px at most).";
  }
  if (!summary.is_certified) return maximum + ", not proved optimal.";
  // Downwards: more than this is not proved.
  const double bound = std::floor(*summary.lower_bound * 1e4) / 1e4;
  const double gap_percent = 100 * *summary.relative_gap;
  const std::string gap =
      gap_percent < 1e-4 ? "less than 0.0001" : FormatNumber(gap_percent, 4);
  return maximum + ", proved optimal to " + gap + " %: no estimate is below " +
         FormatNumber(bound, 4) + " px.";
}

// " on 3 % of the observations"; empty where the joint solver did not run.
std::string WorkingSetWords(const SolveSummary& summary) {
  if (!summary.num_working_observations) return "";
  const int64_t count = *summary.num_working_observations;
  if (count == summary.num_observations) return " on all observations";
  const double percent = 100 * static_cast<double>(count) /
                         static_cast<double>(summary.num_observations);
  return " on " +
         (percent < 1 ? std::string("less than 1")
                      : FormatNumber(std::floor(percent), 0)) +
         " % of the observations";
}

// " after 12 joint iterations on 3 % of the observations and 4 sweeps".
std::string StepsWords(const SolveSummary& summary) {
  const std::string sweeps =
      Counted(static_cast<int64_t>(summary.sweeps.size()), "sweep");
  const auto num_starting = std::count_if(
      summary.iterations.begin(), summary.iterations.end(),
      [](const JointIteration& state) { return state.target.has_value(); });
  const int64_t num_joint =
      static_cast<int64_t>(summary.iterations.size()) - num_starting;
  const std::string starting =
      num_starting > 0 ? Counted(num_starting, "iteration") + " to a start, "
                       : "";
  if (summary.method == SolveMethod::kResInt) {
    return " after " + starting + sweeps;
  }
  return " after " + starting + Counted(num_joint, "joint iteration") +
         WorkingSetWords(summary) + " and " + sweeps;
}

std::string TerminationSentence(const SolveSummary& summary) {
  const std::string after = StepsWords(summary);
  switch (summary.termination) {
    case SolveTermination::kGapReached:
      return "Ended" + after + " with the gap asked for.";
    case SolveTermination::kMaxIterations:
      return "Ended" + after + ", as many iterations as were allowed.";
    case SolveTermination::kStalled:
      return "Stalled" + after +
             (summary.method == SolveMethod::kResInt
                  ? ": the last one gained less than the tolerance; whether a "
                    "lower cost exists is not known."
                  : ": no further progress was made.");
    case SolveTermination::kZeroCost:
      return "Ended" + after + " with nothing left to lower.";
    case SolveTermination::kMaxSweeps:
      return "Ended" + after + ", as many as were allowed.";
    case SolveTermination::kInterrupted:
      return "Interrupted" + after + ".";
    case SolveTermination::kNothingToSolve:
      return NothingToSolveSentence(summary) + ".";
    case SolveTermination::kInfeasible:
    case SolveTermination::kNoStart:
    case SolveTermination::kNotRun:
      break;
  }
  return "Not run.";
}

int64_t NumLeftOut(const SolveSummary& summary) {
  return std::accumulate(summary.left_out.begin(), summary.left_out.end(),
                         int64_t{0});
}

// "short_track 12, behind 3"; empty if nothing was left out.
std::string LeftOutList(const SolveSummary& summary) {
  std::string list;
  for (int reason = 0; reason < kNumLeftOutReasons; ++reason) {
    if (summary.left_out[reason] == 0) continue;
    if (!list.empty()) list += ", ";
    list += std::string(LeftOutName(static_cast<LeftOut>(reason))) + " " +
            std::to_string(summary.left_out[reason]);
  }
  return list;
}

std::string CountsSentence(const SolveSummary& summary) {
  std::ostringstream text;
  text << Counted(summary.num_frames, "frame") << ", "
       << Counted(summary.num_images, "image") << ", "
       << Counted(summary.num_points, "point") << ", "
       << Counted(summary.num_observations, "observation")
       << " in the optimisation; "
       << Counted(NumLeftOut(summary), "observation") << " left out";
  const std::string list = LeftOutList(summary);
  if (!list.empty()) text << " (" << list << ")";
  if (summary.num_retriangulated_points > 0) {
    text << "; " << Counted(summary.num_retriangulated_points, "point")
         << " re-triangulated at the start";
  }
  return text.str() + ".";
}

}  // namespace

std::string NothingToSolveSentence(const SolveSummary& summary) {
  const int64_t num_left_out = NumLeftOut(summary);
  if (num_left_out == 0) {
    return "nothing to solve: the model has no observations";
  }
  return "nothing to solve: " + Counted(num_left_out, "observation") +
         " left out (" + LeftOutList(summary) + ")";
}

std::string SolveTable(const SolveReport& report) {
  const SolveSummary& summary = report.summary;
  const PixelErrorStatistics& after = summary.pixel_error_after;

  std::ostringstream text;
  text << "\nReprojection errors, p = " << NormName(summary.norm)
       << " for the cost, Euclidean for the rest\n"
       << SolveErrorTable(summary) << CountsSentence(summary) << '\n';
  if (after.not_finite > 0) {
    text << Counted(after.not_finite, "observation")
         << " without a finite error (behind the camera, no pose, or not "
            "projectable), in no row above.\n";
  }
  if (summary.num_components > 1) {
    text << "The problem falls into "
         << Counted(summary.num_components, "component")
         << " without observations in common; each is solved.\n";
  }
  text << TerminationSentence(summary) << '\n' << Verdict(summary) << '\n';
  if (summary.is_certified) {
    text << SupportTable(summary.support, kListedSupport);
  }
  text << (summary.is_certified ? "\n" : "") << "Read "
       << FormatNumber(report.seconds_read, 2) << " s, built "
       << FormatNumber(summary.seconds_build, 2) << " s, solved "
       << FormatNumber(summary.seconds_solve, 2) << " s, wrote "
       << FormatNumber(report.seconds_write, 2) << " s; "
       << FormatNumber(report.seconds_total, 2) << " s in all on "
       << Counted(report.threads, "thread") << ", "
       << FormatBytes(report.peak_memory_bytes) << " at most.\n";
  return text.str();
}

}  // namespace krot
