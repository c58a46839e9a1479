#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "krot/outliers/outlier_filter.h"
#include "krot/report/run_record.h"

namespace krot::internal {

// What one run of `krot outlier_filter` did.
struct OutlierReport {
  RunRecord run;
  OutlierFilterSummary summary;
};

// "removed 74 of 26,268; at least 61 must go (61 disjoint conflicts,
// certificate)".
std::string BracketSentence(const OutlierFilterSummary& summary);

// Why positions from nothing are not to be relied on, and what to do next:
// parts whose scale hardly anything holds, a bound beyond reason, or more
// observations that do not fit than do. Empty if they are, or have not been
// found from nothing.
std::string UnreliableSentence(const OutlierFilterSummary& summary);

// [{"image_names": ..}], of OutlierFilterSummary::weak_parts.
nlohmann::ordered_json WeakPartsJson(const OutlierFilterSummary& summary);

// For the terminal: the bracket, errors before and after, who is to blame.
std::string OutlierTable(const OutlierReport& report);

// report.json; the keys are listed in docs/cli.md. What is not known is null.
std::string OutlierJson(const OutlierReport& report);

// The error profile alone (docs/formats.md), which there must be.
std::string ProfileJson(const OutlierReport& report);

// One line per removed observation, worst first, behind a line of names.
std::string OutlierCsv(const OutlierFilterSummary& summary);

// As --OutlierFilter.method takes it.
std::string OutlierMethodName(OutlierMethod method);

}  // namespace krot::internal
