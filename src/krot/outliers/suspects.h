#pragma once

#include <cstdint>
#include <vector>

#include "krot/model.h"
#include "krot/outliers/outlier_filter.h"

namespace krot::internal {

// Fills in the tracks, images and cameras of a summary: who has observations
// that were removed, by how many. `conflict_of` says for each track element of
// the input which conflict it is in, -1: none, and `is_removed` whether it was
// removed.
void RankSuspects(const Model& model, const std::vector<char>& is_removed,
                  const std::vector<int64_t>& conflict_of,
                  OutlierFilterSummary* summary);

}  // namespace krot::internal
