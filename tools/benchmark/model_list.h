#pragma once

#include <functional>
#include <string>
#include <vector>

#include "tools/benchmark/benchmark_options.h"

namespace krot::internal {

// Calls `measure` with every input path. If that throws, the model is left out
// of the results: it is named on stderr and in the sentences returned, which
// are notes below the table. If no model is left, rethrows the last exception.
std::vector<std::string> MeasureModels(
    const BenchmarkOptions& options,
    const std::function<void(const std::string& path)>& measure);

}  // namespace krot::internal
