// For builds without Ceres: nothing can be adjusted.

#include "krot/adjust/bundle_adjustment.h"

namespace krot::internal {

BundleAdjustmentResult AdjustBundle(const Model&,
                                    const BundleAdjustmentOptions&,
                                    const Context&, AdjustmentDatum,
                                    std::optional<AdjustmentPrecision>*) {
  throw NoCeresError(
      "bundle adjustment needs Ceres, which this krot was built without; take "
      "a krot with Ceres");
}

void SilenceCeres() {}

}  // namespace krot::internal
