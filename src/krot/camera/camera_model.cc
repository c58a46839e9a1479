#include "krot/camera/camera_model.h"

#include <algorithm>

namespace krot {

const std::vector<CameraModelInfo>& CameraModels() {
  static const std::vector<CameraModelInfo> models = {
      {0, "SIMPLE_PINHOLE", "f, cx, cy", 3, true},
      {1, "PINHOLE", "fx, fy, cx, cy", 4, true},
      {2, "SIMPLE_RADIAL", "f, cx, cy, k", 4, true},
      {3, "RADIAL", "f, cx, cy, k1, k2", 5, true},
      {4, "OPENCV", "fx, fy, cx, cy, k1, k2, p1, p2", 8, true},
      {5, "OPENCV_FISHEYE", "fx, fy, cx, cy, k1, k2, k3, k4", 8, true},
      {6, "FULL_OPENCV", "fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6", 12,
       true},
      {7, "FOV", "fx, fy, cx, cy, omega", 5, true},
      {8, "SIMPLE_RADIAL_FISHEYE", "f, cx, cy, k", 4, true},
      {9, "RADIAL_FISHEYE", "f, cx, cy, k1, k2", 5, true},
      {10, "THIN_PRISM_FISHEYE",
       "fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1", 12, true},
      {11, "RAD_TAN_THIN_PRISM_FISHEYE",
       "fx, fy, cx, cy, k0, k1, k2, k3, k4, k5, p0, p1, s0, s1, s2, s3", 16,
       true},
      {12, "SIMPLE_DIVISION", "f, cx, cy, k", 4, true},
      {13, "DIVISION", "fx, fy, cx, cy, k", 5, true},
      {14, "SIMPLE_FISHEYE", "f, cx, cy", 3, true},
      {15, "FISHEYE", "fx, fy, cx, cy", 4, true},
      {16, "EUCM", "fx, fy, cx, cy, alpha, beta", 6, true},
      {17, "EQUIRECTANGULAR", "w, h", 2, false},
  };
  return models;
}

const CameraModelInfo* FindCameraModel(int id) {
  const std::vector<CameraModelInfo>& models = CameraModels();
  if (id < 0 || id >= static_cast<int>(models.size())) return nullptr;
  return &models[id];
}

const CameraModelInfo* FindCameraModel(std::string_view name) {
  const std::vector<CameraModelInfo>& models = CameraModels();
  const auto model = std::find_if(
      models.begin(), models.end(),
      [&](const CameraModelInfo& info) { return info.name == name; });
  return model == models.end() ? nullptr : &*model;
}

}  // namespace krot
