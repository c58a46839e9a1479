#include "krot/minimax/kernels.h"

#include <limits>

#include "krot/base/vector_units.h"

namespace krot::internal {

KROT_DECLARE_KERNELS(ResidualKernels, kResidualKernels)
KROT_DECLARE_KERNELS(LaneKernels, kLaneKernels)

const ResidualKernels& best_residual_kernels =
    KROT_BEST_KERNELS(kResidualKernels);
const LaneKernels& best_lane_kernels = KROT_BEST_KERNELS(kLaneKernels);

void LaneDescents::Begin(int lane) {
  iterations[lane] = 0;
  bool is_warm = false;
  for (int a = 0; a < kCorners; ++a) {
    weight[a][lane] = multiplier[a][lane];
    const bool is_corner = multiplier[a][lane] > 0;
    if (!is_corner) index[a][lane] = kNoPieceIndex;
    is_warm |= is_corner;
  }
  is_cold[lane] = is_warm ? 0 : 1;
  raises[lane] = 0;
  kappa[lane] = kFirstKappa;
  lessons[lane] = 0;
  cost_failed[lane] = std::numeric_limits<double>::infinity();
  calls[lane] = 0;
}

}  // namespace krot::internal
