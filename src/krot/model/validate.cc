#include "krot/model/validate.h"

#include <string>

#include "krot/camera/camera_model.h"
#include "krot/model/validate_parts.h"

namespace krot {
namespace {

template <typename Id>
void CheckUnique(const IdIndex<Id>& index, const char* records) {
  if (!index.duplicate()) return;
  Fail(records, ": found id ", *index.duplicate(),
       " twice, expected unique ids");
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

void CheckImage(const Image& image, const IdIndex<CameraId>& cameras) {
  const auto owner = [&] { return Describe(image); };
  if (image.name.find('\0') != std::string::npos) {
    Fail("image ", image.id, ": found a zero byte in its name, expected none");
  }
  if (!cameras.Find(image.camera_id)) {
    Fail(owner(), ": found camera id ", image.camera_id,
         ", expected one that exists in cameras");
  }
  CheckRotation(image.cam_from_world, owner);
  for (const Point2D& point : image.points2D) {
    CheckFinite(point.x, owner, "the x of a 2D point");
    CheckFinite(point.y, owner, "the y of a 2D point");
  }
}

void CheckPoint3D(const Point3D& point) {
  const auto owner = [&] { return "3D point " + std::to_string(point.id); };
  if (point.id == kInvalidPoint3DId) {
    Fail(owner(),
         ": found the id that stands for no 3D point, expected another");
  }
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
  CheckUnique(indexed.cameras, "cameras");
  CheckUnique(indexed.images, "images");
  CheckUnique(indexed.rigs, "rigs");
  CheckUnique(indexed.frames, "frames");
  CheckUnique(indexed.points3D, "points3D");
  for (const Camera& camera : model.cameras) CheckCamera(camera);
  for (const Image& image : model.images) CheckImage(image, indexed.cameras);
  ValidateRigsAndFrames(indexed);
  for (const Point3D& point : model.points3D) CheckPoint3D(point);
  CheckTracksAreConsecutive(model);
  ValidateObservations(indexed);
}

}  // namespace krot
