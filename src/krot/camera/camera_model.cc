#include "krot/camera/camera_model.h"

#include <algorithm>

#include "krot/camera/models.h"
#include "krot/camera/undistort.h"

namespace krot::internal {
namespace {

template <typename Model>
CameraModelInfo Info(bool has_image_plane) {
  return {Model::kId, Model::kName, Model::kParamNames, Model::kNumParams,
          has_image_plane};
}

std::vector<CameraModelInfo> ListCameraModels() {
  std::vector<CameraModelInfo> models;
  for (int id = 0; id < Equirectangular::kId; ++id) {
    models.push_back(VisitCameraModel(
        id, [](auto model) { return Info<decltype(model)>(true); }));
  }
  models.push_back(Info<Equirectangular>(false));
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
