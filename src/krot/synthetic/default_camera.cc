#include "krot/synthetic/default_camera.h"

#include <string_view>

#include "krot/base/check.h"
#include "krot/camera/camera_model.h"

namespace krot::internal {
namespace {

// What follows the principal point, by COLMAP's model id.
const std::vector<double>& DefaultDistortion(int model_id) {
  static const std::vector<std::vector<double>> kDistortions = {
      {},                               // SIMPLE_PINHOLE
      {},                               // PINHOLE
      {-0.03},                          // SIMPLE_RADIAL
      {-0.03, 0.004},                   // RADIAL
      {-0.03, 0.004, 1e-3, -5e-4},      // OPENCV
      {-0.02, 4e-3, -5e-4, 5e-5},       // OPENCV_FISHEYE
      {-0.03, 0.004, 1e-3, -5e-4,       // FULL_OPENCV
       1e-3, 0.01, -2e-3, 5e-4},        //
      {0.5},                            // FOV
      {-0.02},                          // SIMPLE_RADIAL_FISHEYE
      {-0.02, 4e-3},                    // RADIAL_FISHEYE
      {-0.02, 4e-3, 1e-3, -5e-4,        // THIN_PRISM_FISHEYE
       -5e-4, 5e-5, 1e-3, -1e-3},       //
      {-0.02, 4e-3, -5e-4, 5e-5, 0, 0,  // RAD_TAN_THIN_PRISM_FISHEYE
       1e-3, -5e-4, 1e-3, -5e-4, -1e-3, 5e-4},
      {-0.05},      // SIMPLE_DIVISION
      {-0.05},      // DIVISION
      {},           // SIMPLE_FISHEYE
      {},           // FISHEYE
      {0.6, 1.05},  // EUCM
  };
  return kDistortions.at(static_cast<size_t>(model_id));
}

}  // namespace

Camera DefaultCamera(int model_id, uint64_t width, uint64_t height,
                     double focal_length) {
  const CameraModelInfo* info = FindCameraModel(model_id);
  CheckArgument(info != nullptr, "camera_model_id", model_id,
                "the id of a camera model");
  constexpr std::string_view kTwoFocalLengths = "fx";
  const bool two_focal_lengths =
      info->param_names.substr(0, 2) == kTwoFocalLengths;

  Camera camera;
  camera.model_id = model_id;
  camera.width = width;
  camera.height = height;
  if (!info->has_image_plane) {
    camera.params = {static_cast<double>(width), static_cast<double>(height)};
    return camera;
  }
  camera.params = {focal_length};
  if (two_focal_lengths) camera.params.push_back(1.01 * focal_length);
  camera.params.push_back(static_cast<double>(width) / 2);
  camera.params.push_back(static_cast<double>(height) / 2);
  const std::vector<double>& distortion = DefaultDistortion(model_id);
  camera.params.insert(camera.params.end(), distortion.begin(),
                       distortion.end());
  return camera;
}

}  // namespace krot::internal
