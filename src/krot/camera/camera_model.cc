#include "krot/camera/camera_model.h"

#include <algorithm>

#include "krot/camera/models.h"
#include "krot/camera/undistort.h"

namespace krot::internal {
namespace {

// Name and parameters, in the order of the ids.
constexpr std::string_view kNames[][2] = {
    {"SIMPLE_PINHOLE", "f, cx, cy"},
    {"PINHOLE", "fx, fy, cx, cy"},
    {"SIMPLE_RADIAL", "f, cx, cy, k"},
    {"RADIAL", "f, cx, cy, k1, k2"},
    {"OPENCV", "fx, fy, cx, cy, k1, k2, p1, p2"},
    {"OPENCV_FISHEYE", "fx, fy, cx, cy, k1, k2, k3, k4"},
    {"FULL_OPENCV", "fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6"},
    {"FOV", "fx, fy, cx, cy, omega"},
    {"SIMPLE_RADIAL_FISHEYE", "f, cx, cy, k"},
    {"RADIAL_FISHEYE", "f, cx, cy, k1, k2"},
    {"THIN_PRISM_FISHEYE", "fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1"},
    {"RAD_TAN_THIN_PRISM_FISHEYE",
     "fx, fy, cx, cy, k0, k1, k2, k3, k4, k5, p0, p1, s0, s1, s2, s3"},
    {"SIMPLE_DIVISION", "f, cx, cy, k"},
    {"DIVISION", "fx, fy, cx, cy, k"},
    {"SIMPLE_FISHEYE", "f, cx, cy"},
    {"FISHEYE", "fx, fy, cx, cy"},
    {"EUCM", "fx, fy, cx, cy, alpha, beta"},
    {"EQUIRECTANGULAR", "w, h"},
};

std::vector<CameraModelInfo> ListCameraModels() {
  std::vector<CameraModelInfo> models;
  for (const auto& [name, param_names] : kNames) {
    const auto id = static_cast<int>(models.size());
    const int num_params = VisitEveryCameraModel(
        id, [](auto model) { return decltype(model)::kNumParams; });
    models.push_back(
        {id, name, param_names, num_params, id != Equirectangular::kId});
  }
  return models;
}

}  // namespace

const std::vector<CameraModelInfo>& CameraModels() {
  static const std::vector<CameraModelInfo> models = ListCameraModels();
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

Eigen::Vector2d ProjectRay(int model_id, const double* params,
                           const Eigen::Vector2d& u) {
  return VisitCameraModel(model_id, [&](auto model) {
    Eigen::Vector2d pixel;
    model.Project(params, u.x(), u.y(), &pixel.x(), &pixel.y());
    return pixel;
  });
}

Eigen::Matrix2d ProjectionJacobian(int model_id, const double* params,
                                   const Eigen::Vector2d& u) {
  return VisitCameraModel(model_id, [&](auto model) {
    return Differentiate(u, [&](const auto& a, const auto& b, auto* x,
                                auto* y) { model.Project(params, a, b, x, y); })
        .derivative;
  });
}

UndistortStatus UndistortPixel(int model_id, const double* params,
                               const Eigen::Vector2d& pixel,
                               const std::optional<Eigen::Vector2d>& u_start,
                               UndistortedObservation* result) {
  return VisitCameraModel(model_id, [&](auto model) {
    return Undistort<decltype(model)>(params, pixel, u_start, result);
  });
}

}  // namespace krot::internal
