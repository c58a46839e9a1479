#pragma once

#include <optional>
#include <string>

#include "krot/outliers/outlier_filter.h"
#include "krot/pipeline/solve_model.h"
#include "krot/report/problem_words.h"
#include "krot/report/run_record.h"

namespace krot::internal {

// What one run of `krot solver` or `krot point_triangulator` did.
struct SolveReport {
  RunRecord run;
  std::string command;
  std::string method;
  SolveSummary summary;
  // Where not everything was to stay; its own solve is the summary above.
  std::optional<OutlierFilterSummary> outliers;
};

// For the terminal: errors before and after, what was left out, why it ended,
// how long it took.
std::string SolveTable(const SolveReport& report);

// report.json; the keys are listed in docs/cli.md. What is not known is null.
std::string SolveJson(const SolveReport& report);

LeftOutCounts LeftOutByReason(const SolveSummary& summary);

// "nothing to solve: 1000 observations left out (short_track 1000)". Requires
// the termination kNothingToSolve.
std::string NothingToSolveSentence(const SolveSummary& summary);

// The points in whose tracks an image occurs more than once, of the support.
std::vector<Point3DId> SameImageInSupport(const SolveSummary& summary);

// Whether the cost is, to the digits shown, the largest error of the model that
// is written: it is with p = 2 if every observation takes part.
bool CostIsMaximum(const SolveSummary& summary);

// The maximum of the model that is written and what is proved of it, and what
// is not: on the terminal, in the report and on the page.
std::string VerdictSentence(const SolveSummary& summary);

// "0.0100 %", "less than 0.0001 %".
std::string GapPercent(double relative_gap);

// "proved to be within 0.0100 % of the lowest".
std::string GapWords(double relative_gap);

// "2 observations are too few to determine 2 frames and 1 point". Requires
// is_underdetermined.
std::string UnderdeterminedWords(const SolveSummary& summary);

// "the gap asked for is not reached after 300 iterations, as many as ...".
std::string MissedGapSentence(const SolveSummary& summary);

// That of the last round's linear problem; none if nothing is proved of it.
std::optional<double> LinearRelativeGap(const SolveSummary& summary);

// What was written instead of a better model. Requires is_given_back.
std::string GivenBackSentence(const SolveSummary& summary);

// As --Solver.method takes it.
std::string MethodName(SolveMethod method);

// As --Solver.norm takes it: "1", "2", "inf", "1.5".
std::string NormName(Norm norm);

}  // namespace krot::internal
