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
// as in a model without poses, the model is a copy of the input.
//
// Then conflicts are looked for: no translations and points bring all errors
// within what noise explains of each: critical_w sigma sqrt(r), with r the
// larger eigenvalue of its R_ii (krot/check.h) in its track as it was read.
// What was removed is enough for that, and noise alone has no conflict with
// probability 95 %.
//
// The same bits at any number of threads. Throws ModelError for cameras without
// an image plane.
OutlierFilterResult FilterBySnooping(const Model& model,
                                     const OutlierFilterOptions& options,
                                     const Context& context);

}  // namespace krot::internal
