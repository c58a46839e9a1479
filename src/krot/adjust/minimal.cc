// For builds without Ceres: nothing can be adjusted.

#include "krot/adjust/precision.h"
#include "krot/base/check.h"

namespace krot::internal {

BundleAdjustmentResult AdjustBundle(const Model&,
                                    const BundleAdjustmentOptions&,
                                    const Context&) {
  throw NoCeresError(
      "bundle adjustment needs Ceres, which this krot was built without; take "
      "a krot with Ceres");
}

BundleAdjustmentResult AdjustBundle(const Model& model,
                                    const BundleAdjustmentOptions& options,
                                    const Context& context, AdjustmentDatum,
                                    std::optional<AdjustmentPrecision>*) {
  return AdjustBundle(model, options, context);
}

void SilenceCeres() {}

}  // namespace krot::internal
