#include "krot/pipeline/polish.h"

#include <utility>
#include <vector>

namespace krot {
namespace {

BundleAdjustmentOptions PolishOptions(Polish polish) {
  BundleAdjustmentOptions options;
  if (polish == Polish::kFull) return options;
  options.constant_rig_from_world_rotation = true;
  options.refine_sensor_from_rig = false;
  options.refine_focal_length = false;
  options.refine_extra_params = false;
  return options;
}

}  // namespace

PolishSummary PolishModel(Polish polish, const Context& context, Model* model) {
  BundleAdjustmentResult adjusted =
      AdjustBundle(*model, PolishOptions(polish), context);
  const std::vector<double> errors_px =
      PixelErrors(adjusted.model, context.num_threads);
  UpdatePointErrors(errors_px, &adjusted.model);
  *model = std::move(adjusted.model);
  return {polish, std::move(adjusted.summary), Summarize(errors_px)};
}

const char* PolishName(Polish polish) {
  switch (polish) {
    case Polish::kRotationsFixed:
      return "rotations_fixed";
    case Polish::kFull:
      return "full";
    case Polish::kNone:
      break;
  }
  return "none";
}

}  // namespace krot
