#include <algorithm>
#include <cmath>

#include "krot/base/check.h"
#include "krot/camera/camera_model.h"
#include "krot/synthetic/scene.h"

namespace krot::internal {
namespace {

template <typename Value>
void CheckRange(const char* name, Value value, Value low, Value high) {
  const bool ok = value >= low && value <= high;  // false for NaN
  std::ostringstream range;
  range << "in [" << low << ", " << high << "]";
  CheckArgument(ok, name, value, range.str());
}

}  // namespace

void Check(const SceneOptions& options) {
  CheckRange("num_frames", options.num_frames, 2, 10'000'000);
  CheckRange("num_points", options.num_points, 1, 1'000'000'000);
  const CameraModelInfo* camera = FindCameraModel(options.camera_model_id);
  CheckArgument(camera != nullptr, "camera_model_id", options.camera_model_id,
                "the id of a camera model, 0 to 17");
  CheckRange("image_width", options.image_width, 64, 65536);
  CheckRange("image_height", options.image_height, 64, 65536);
  CheckRange("focal_length_factor", options.focal_length_factor, 0.5, 10.0);

  CheckRange("sensors_per_rig", options.sensors_per_rig, 1, 16);
  CheckArgument(options.has_rigs || options.sensors_per_rig == 1,
                "sensors_per_rig", options.sensors_per_rig,
                "1 in a model without rigs (has_rigs = 0)");
  CheckRange("rig_baseline", options.rig_baseline, 0.0, 0.2);
  CheckRange("rig_rotation_deg", options.rig_rotation_deg, 0.0, 180.0);
  const double num_images =
      static_cast<double>(options.num_frames) * options.sensors_per_rig;
  CheckRange("track_length", options.track_length, 2.0, num_images);

  CheckRange("pixel_noise", options.pixel_noise, 0.0, 10.0);
  CheckRange("outlier_ratio", options.outlier_ratio, 0.0, 0.9);
  CheckRange("duplicate_ratio", options.duplicate_ratio, 0.0, 1.0);
  CheckRange("start_translation_noise", options.start_translation_noise, 0.0,
             1.0);
  CheckRange("start_point_noise", options.start_point_noise, 0.0, 1.0);
  CheckRange("rotation_noise_deg", options.rotation_noise_deg, 0.0, 2.0);
}

}  // namespace krot::internal
