#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tools/benchmark/benchmark_options.h"

namespace krot::internal {

// Calls `measure` with every input path. A model that it throws for is left
// out of the results: named on stderr and in the sentences returned, for below
// the table. If that leaves nothing, throws what the last one threw.
std::vector<std::string> MeasureModels(
    const BenchmarkOptions& options,
    const std::function<void(const std::string& path)>& measure);

}  // namespace krot::internal
