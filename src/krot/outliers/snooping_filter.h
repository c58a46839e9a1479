#pragma once

#include "krot/base/context.h"
#include "krot/model.h"
#include "krot/outliers/outlier_filter.h"

namespace krot::internal {

// FilterOutliers with OutlierMethod::kSnooping, which asks for no bound. With
// the cameras as they stand, what noise does not explain is removed
// (SnoopNoise). Then translations and points move to the least squares of what
// is left, rotations and intrinsics fixed, and it begins anew, until the least
// squares leaves nothing to remove. As options.solve.finish.loss says, it is
// the least of a robust loss. Where nothing is removed, or there is no sigma,
// as in a model without poses, the model is a copy of the input. The same bits
// at any number of threads. Throws ModelError for cameras without an image
// plane.
OutlierFilterResult FilterBySnooping(const Model& model,
                                     const OutlierFilterOptions& options,
                                     const Context& context);

}  // namespace krot::internal
