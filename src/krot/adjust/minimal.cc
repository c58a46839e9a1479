// Where there is no Ceres: nothing can be adjusted.

#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/check.h"

namespace krot::internal {

BundleAdjustmentResult AdjustBundle(const Model&,
                                    const BundleAdjustmentOptions&,
                                    const Context&) {
  throw std::invalid_argument(
      "bundle adjustment is not in this build, which has no Ceres");
}

void SilenceCeres() {}

}  // namespace krot::internal
