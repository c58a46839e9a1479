#include "krot/pipeline/polish.h"

#include <utility>
#include <vector>

namespace krot::internal {
namespace {

RobustLoss LossOf(ErrorLoss::Kind kind) {
  switch (kind) {
    case ErrorLoss::Kind::kHuber:
      return RobustLoss::kHuber;
    case ErrorLoss::Kind::kCauchy:
      return RobustLoss::kCauchy;
    case ErrorLoss::Kind::kTrivial:
      break;
  }
  return RobustLoss::kTrivial;
}

BundleAdjustmentOptions PolishOptions(Polish polish, const ErrorLoss& loss) {
  BundleAdjustmentOptions options;
  options.loss = LossOf(loss.kind);
  options.loss_scale = loss.scale;
  if (polish == Polish::kFull) return options;
  options.constant_rig_from_world_rotation = true;
  options.refine_sensor_from_rig = false;
  options.refine_focal_length = false;
  options.refine_extra_params = false;
  return options;
}

}  // namespace

PolishSummary PolishModel(Polish polish, const ErrorLoss& loss,
                          const FixedParts& fixed, const Context& context,
                          Model* model) {
  BundleAdjustmentOptions options = PolishOptions(polish, loss);
  options.fixed = fixed;
  BundleAdjustmentResult adjusted = AdjustBundle(*model, options, context);
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

}  // namespace krot::internal
