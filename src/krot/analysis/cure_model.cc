#include <vector>

#include "krot/check.h"
#include "krot/model/derived_models.h"
#include "krot/model/rigs.h"

namespace krot {

using namespace internal;

namespace {

// Moves images whose position alone is wrong to where their matches fit, unless
// other images share their frame. Returns whether there are any.
bool MoveImages(const PairCheck& pairs, Model* moved) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(*moved);
  std::vector<int> num_images(moved->frames.size(), 0);
  for (const ImageGeometry& geometry : geometries) {
    if (geometry.has_pose) ++num_images[geometry.frame];
  }
  bool is_any = false;
  for (size_t n = 0; n < geometries.size(); ++n) {
    const ImageGeometry& geometry = geometries[n];
    if (pairs.images[n].fault != PoseFault::kPosition ||
        num_images[geometry.frame] > 1) {
      continue;
    }
    const RigidTransform& to = pairs.images[n].moved_cam_from_world;
    moved->frames[geometry.frame].rig_from_world.translation =
        (Inverse(geometry.cam_from_rig) * to).translation;
    moved->images[n].cam_from_world.translation = to.translation;
    is_any = true;
  }
  return is_any;
}

Model Removed(const Model& model, const ModelCheck& check,
              const Context& context) {
  if (!check.IsAnythingWrong()) return model;
  std::vector<char> is_wrong_image;
  for (const ImageCheck& image : check.images) {
    is_wrong_image.push_back(image.verdict == ImageVerdict::kWrong);
  }
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  std::vector<char> is_removed(model.track_elements.size(), 0);
  for (const WrongObservation& one : check.observations) {
    is_removed[one.element] = 1;
  }
  Model moved = model;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const Point3D& point = model.points3D[k];
    bool is_any = false;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      is_removed[e] |= is_wrong_image[image_of[e]];
      is_any |= is_removed[e];
    }
    if (is_any) moved.points3D[k].xyz = check.points[k];
  }
  Model cured =
      RemoveImages(RemoveObservations(moved, is_removed).model, is_wrong_image);
  UpdatePointErrors(PixelErrors(cured, context.num_threads), &cured);
  return cured;
}

}  // namespace

ModelCure CureModel(const Model& model, const ModelCheck& check,
                    const ModelCheckOptions& options, const Context& context) {
  Model moved = model;
  if (!check.pairs || !MoveImages(*check.pairs, &moved)) {
    return {Removed(model, check, context), {}};
  }
  const ModelCheck again = CheckModel(moved, options, context);
  ModelCure cure = {Removed(moved, again, context), {}};
  for (size_t n = 0; n < check.images.size(); ++n) {
    if (check.pairs->images[n].is_wrong &&
        again.images[n].verdict != ImageVerdict::kWrong) {
      cure.moved.push_back(check.images[n].name);
    }
  }
  return cure;
}

}  // namespace krot
