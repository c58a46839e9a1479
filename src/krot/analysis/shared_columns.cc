#include "krot/analysis/shared_columns.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include "krot/camera/camera_model.h"

namespace krot::internal {
namespace {

using Eigen::Index;

// Of a difference quotient, relative to parameters above 1: its square and the
// rounding of pixels over it are both far below a pixel.
constexpr double kParamStep = 1e-6;

std::vector<std::string_view> ParamNames(const Camera& camera) {
  std::vector<std::string_view> names;
  std::string_view rest = FindCameraModel(camera.model_id)->param_names;
  while (!rest.empty()) {
    const size_t comma = rest.find(", ");
    names.push_back(rest.substr(0, comma));
    rest = comma == std::string_view::npos ? "" : rest.substr(comma + 2);
  }
  return names;
}

CameraFault FaultOfParam(std::string_view name) {
  if (name == "f" || name == "fx" || name == "fy") {
    return CameraFault::kFocalLength;
  }
  return name == "cx" || name == "cy" ? CameraFault::kPrincipalPoint
                                      : CameraFault::kDistortion;
}

}  // namespace

SharedColumns::SharedColumns(const Model& model,
                             const std::vector<ImageGeometry>& geometries,
                             const std::vector<ImageSums>& sums)
    : model_(model), geometries_(geometries) {
  AddLenses();
  AddPlaces();
  Number();
  for (size_t n = 0; n < sums.size(); ++n) {
    if (!geometries[n].has_pose) continue;
    const auto add = [&](int32_t g) {
      ++groups_[g].num_images;
      groups_[g].num_directions += sums[n].num_directions;
      groups_[g].square += sums[n].square;
    };
    for (const int32_t g : groups_of_camera_[geometries[n].camera]) add(g);
    if (place_of_image_[n] >= 0) add(place_of_image_[n]);
  }
}

void SharedColumns::Keep(const std::vector<char>& is_kept) {
  for (size_t n = 0; n < groups_.size(); ++n) {
    if (!is_kept[n]) groups_[n].size = 0;
  }
  Number();
}

void SharedColumns::AddLenses() {
  groups_of_camera_.resize(model_.cameras.size());
  for (size_t c = 0; c < model_.cameras.size(); ++c) {
    const Camera& camera = model_.cameras[c];
    if (!FindCameraModel(camera.model_id)->has_image_plane) continue;
    const std::vector<std::string_view> names = ParamNames(camera);
    for (const CameraFault fault :
         {CameraFault::kFocalLength, CameraFault::kPrincipalPoint,
          CameraFault::kDistortion}) {
      SharedGroup group;
      group.camera = static_cast<int32_t>(c);
      group.fault = fault;
      for (size_t i = 0; i < names.size(); ++i) {
        if (FaultOfParam(names[i]) == fault) {
          group.params.push_back(static_cast<int>(i));
        }
      }
      group.size = static_cast<Index>(group.params.size());
      if (group.size == 0) continue;
      groups_of_camera_[c].push_back(static_cast<int32_t>(groups_.size()));
      groups_.push_back(group);
    }
  }
}

void SharedColumns::AddPlaces() {
  std::map<std::pair<int32_t, int32_t>, int32_t> group_of;
  for (const ImageGeometry& geometry : geometries_) {
    place_of_image_.push_back(-1);
    if (!geometry.has_pose || geometry.sensor < 0) continue;
    const auto [entry, is_new] = group_of.try_emplace(
        {geometry.rig, geometry.sensor}, static_cast<int32_t>(groups_.size()));
    place_of_image_.back() = entry->second;
    if (!is_new) continue;
    SharedGroup& group = groups_.emplace_back();
    group.camera = geometry.camera;
    group.rig = geometry.rig;
    group.fault = CameraFault::kPlaceInRig;
    group.size = 6;
  }
}

void SharedColumns::Number() {
  num_columns_ = 0;
  for (SharedGroup& group : groups_) {
    group.begin = num_columns_;
    num_columns_ += group.size;
  }
}

std::vector<ByGroup> SharedColumns::ByGroups(const PoseRow& row) const {
  const ImageGeometry& geometry = geometries_[row.image];
  std::vector<ByGroup> all;
  Camera camera = model_.cameras[geometry.camera];
  for (const int32_t n : groups_of_camera_[geometry.camera]) {
    const SharedGroup& group = groups_[n];
    if (group.size == 0) continue;
    ByGroup& by = all.emplace_back();
    by.group = n;
    by.C.setZero(2, group.size);
    for (Index i = 0; i < group.size; ++i) {
      double& param = camera.params[group.params[i]];
      const double value = param;
      const double step = kParamStep * std::max(1.0, std::abs(value));
      param = value + step;
      const auto above = ProjectPoint(camera, row.x_cam);
      param = value - step;
      const auto below = ProjectPoint(camera, row.x_cam);
      param = value;
      if (above && below) by.C.col(i) = (*above - *below) / (2 * step);
    }
  }
  const int32_t place = place_of_image_[row.image];
  if (place >= 0 && groups_[place].size > 0) {
    ByGroup& by = all.emplace_back();
    by.group = place;
    by.C.resize(2, 6);
    by.C << row.F.leftCols<3>(),
        row.F.rightCols<3>() * geometry.rig_from_world.rotation.transpose();
  }
  return all;
}

}  // namespace krot::internal
