#pragma once

#include <map>
#include <string>

#include "tools/benchmark/result_table.h"

namespace krot::internal {

// The reports that run_all.sh leaves, parsed, by the names of their files:
// "triangulation", "blocks", ...
using Reports = std::map<std::string, nlohmann::ordered_json>;

// What was asked of KROT's speed and what the reports say to that, one row per
// question; "not measured" where the report, or the row of it, is missing.
ResultTable Summarize(const Reports& reports);

}  // namespace krot::internal
