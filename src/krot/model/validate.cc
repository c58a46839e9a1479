#include "krot/model.h"

#include <limits>
#include <optional>
#include <string>

#include "krot/camera/camera_model.h"
#include "krot/model/validate_parts.h"

namespace krot {

using namespace internal;

namespace {

template <typename Id>
void CheckIds(const IdIndex<Id>& index, const char* records) {
  if (index.duplicate()) {
    Fail(records, ": found id ", *index.duplicate(),
         " twice, expected unique ids");
  }
  constexpr Id kInvalid = std::numeric_limits<Id>::max();
  if (index.Find(kInvalid)) {
    Fail(records, ": found id ", kInvalid,
         ", which in COLMAP stands for none, expected another; renumber it");
  }
}

void CheckCamera(const Camera& camera) {
  const auto owner = [&] { return "camera " + std::to_string(camera.id); };
  const CameraModelInfo* info = FindCameraModel(camera.model_id);
  if (info == nullptr) {
    Fail(owner(), ": found camera model id ", camera.model_id,
         ", expected 0 to ", CameraModels().back().id);
  }
  if (camera.params.size() != static_cast<size_t>(info->num_params)) {
    Fail(owner(), ": found ", camera.params.size(), " parameters, expected ",
         info->num_params, " for ", info->name, " (", info->param_names, ")");
  }
  for (const double param : camera.params) {
    CheckFinite(param, owner, "the parameter");
  }
}

// With a focal length of zero, or a panorama without a side, all rays have one
// pixel.
void CheckFocalLength(const Camera& camera) {
  const CameraModelInfo& info = *FindCameraModel(camera.model_id);
  const bool has_two = info.param_names.substr(0, 2) == "fx" ||
                       info.param_names.substr(0, 1) == "w";
  if (camera.params[0] != 0 && (!has_two || camera.params[1] != 0)) return;
  Fail("camera ", camera.id, ": found 0 for ",
       info.param_names.substr(0, info.param_names.find(", c")), " of ",
       info.name, ", expected what its photos have, in pixels");
}

void CheckImage(const Image& image, const IndexedModel& model) {
  if (image.name.find('\0') != std::string::npos) {
    Fail("image ", image.id, ": found a zero byte in its name, expected none");
  }
  const std::optional<int32_t> camera = model.cameras.Find(image.camera_id);
  if (!camera) {
    Fail(Describe(image), ": found camera id ", image.camera_id,
         ", expected one that exists in cameras");
  }
  CheckFocalLength(model.records.cameras[*camera]);
}

void CheckPoint3D(const Point3D& point) {
  const auto owner = [&] { return "3D point " + std::to_string(point.id); };
  for (const double value : point.xyz) {
    CheckFinite(value, owner, "a coordinate");
  }
}

void CheckTracksAreConsecutive(const Model& model) {
  uint64_t end = 0;
  for (const Point3D& point : model.points3D) {
    if (point.track_begin != end || point.track_end < end) {
      Fail("3D point ", point.id, ": found the track [", point.track_begin,
           ", ", point.track_end, "), expected one that begins at ", end);
    }
    end = point.track_end;
  }
  if (end == model.track_elements.size()) return;
  Fail("found ", model.track_elements.size(),
       " track elements, expected the tracks' total of ", end);
}

}  // namespace

void ValidateModel(const Model& model) {
  const IndexedModel indexed(model);
  CheckIds(indexed.cameras, "cameras");
  CheckIds(indexed.images, "images");
  CheckIds(indexed.rigs, "rigs");
  CheckIds(indexed.frames, "frames");
  CheckIds(indexed.points3D, "points3D");
  for (const Camera& camera : model.cameras) CheckCamera(camera);
  for (const Image& image : model.images) CheckImage(image, indexed);
  ValidateRigsAndFrames(indexed);
  for (const Point3D& point : model.points3D) CheckPoint3D(point);
  CheckTracksAreConsecutive(model);
  ValidateObservations(indexed);
}

}  // namespace krot
