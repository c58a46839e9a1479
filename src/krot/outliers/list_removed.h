#pragma once

#include <cstdint>
#include <vector>

#include "krot/base/context.h"
#include "krot/model.h"
#include "krot/outliers/outlier_filter.h"

namespace krot::internal {

// The removed observations of `model`, worst first, with their errors there and
// where `kept`, what is left of it, has their cameras and points. The vectors
// have an entry per track element of `model`: true errors, whether it was
// removed, which conflict it is in, -1: none, and its w, if there is such.
// O(observations).
std::vector<RemovedObservation> ListRemoved(
    const Model& model, const Model& kept,
    const std::vector<double>& errors_before,
    const std::vector<char>& is_removed,
    const std::vector<int64_t>& conflict_of, const Context& context,
    const std::vector<double>& w = {});

}  // namespace krot::internal
