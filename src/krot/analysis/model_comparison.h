#pragma once

#include <optional>
#include <vector>

#include "krot/analysis/alignment.h"
#include "krot/analysis/model_correspondence.h"
#include "krot/compare.h"

namespace krot::internal {

// The poses of the shared images that have one in both models, in their order.
std::vector<PosePair> SharedPoses(const Model& model1, const Model& model2,
                                  const ModelCorrespondence& correspondence);

// As the public one. Requires valid models (ValidateModel) and the
// correspondence of just these. The result is the same at any thread count.
// O(observations).
std::optional<ComparisonSummary> CompareModels(
    const Model& model1, const Model& model2,
    const ModelCorrespondence& correspondence,
    const CompareModelsOptions& options);

}  // namespace krot::internal
