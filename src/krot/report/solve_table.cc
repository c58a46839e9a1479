#include <algorithm>
#include <cmath>
#include <sstream>

#include "krot/problem/cost.h"
#include "krot/report/certificate_table.h"
#include "krot/report/error_rows.h"
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
  const int64_t count = summary.num_working_observations.value_or(0);
  if (count == 0) return "";
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

std::string SolveEndSentence(const SolveSummary& summary) {
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

std::string SolveCountsSentence(const SolveSummary& summary) {
  return CountsWords(summary) + " in the optimisation; " +
         LeftOutWords(LeftOutByReason(summary)) +
         (summary.num_retriangulated_points > 0
              ? "; " + Counted(summary.num_retriangulated_points, "point") +
                    " re-triangulated at the start."
              : ".");
}

}  // namespace

std::string SolveTable(const SolveReport& report) {
  const SolveSummary& summary = report.summary;
  std::ostringstream text;
  text << "\nReprojection errors, p = " << NormName(summary.norm)
       << " for the cost, Euclidean for the rest\n"
       << SolveErrorTable(summary) << SolveCountsSentence(summary) << '\n'
       << NotFiniteSentence(summary.pixel_error_after);
  if (summary.num_components > 1) {
    text << "The problem falls into "
         << Counted(summary.num_components, "component")
         << " without observations in common; each is solved.\n";
  }
  text << SolveEndSentence(summary) << '\n' << Verdict(summary) << '\n';
  if (summary.is_certified) {
    text << SupportTable(summary.support, kListedSupport);
  }
  text << (summary.is_certified ? "\n" : "")
       << RunSentence(report.run,
                      "built " + FormatNumber(summary.seconds_build, 2) +
                          " s, solved " +
                          FormatNumber(summary.seconds_solve, 2) + " s");
  return text.str();
}

}  // namespace krot
