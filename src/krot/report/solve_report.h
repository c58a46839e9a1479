#pragma once

#include <cstdint>
#include <string>

#include "krot/pipeline/solve_model.h"

namespace krot {

// What one run of `krot solver` or `krot point_triangulator` did.
struct SolveReport {
  std::string version;  // KROT's
  std::string command;
  std::string method;
  SolveSummary summary;
  double seconds_read = 0;  // wall clock
  double seconds_write = 0;
  double seconds_total = 0;
  int64_t peak_memory_bytes = 0;
  int threads = 0;
  uint64_t seed = 0;
};

// For the terminal: errors before and after, what was left out, why it ended,
// how long it took.
std::string SolveTable(const SolveReport& report);

// report.json; the keys are listed in docs/cli.md. What is not known is null.
std::string SolveJson(const SolveReport& report);

// "nothing to solve: 1000 observations left out (short_track 1000)". Requires
// the termination kNothingToSolve.
std::string NothingToSolveSentence(const SolveSummary& summary);

// "the gap asked for is not reached after 300 iterations, as many as ...".
std::string MissedGapSentence(const SolveSummary& summary);

// As --Solver.method takes it.
std::string MethodName(SolveMethod method);

// As --Solver.norm takes it: "1", "2", "inf", "1.5".
std::string NormName(Norm norm);

}  // namespace krot
