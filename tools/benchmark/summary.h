#pragma once

#include <map>
#include <string>

#include "tools/benchmark/result_table.h"

namespace krot::internal {

// The reports that run_all.sh writes, parsed, by the names of their files:
// "triangulation", "blocks", ...
using Reports = std::map<std::string, nlohmann::ordered_json>;

// The requirements on KROT's speed and what was measured, one row for each;
// "not measured" if the report or its row is missing.
ResultTable Summarize(const Reports& reports);

}  // namespace krot::internal
