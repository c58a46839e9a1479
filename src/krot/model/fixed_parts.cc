#include "krot/model/fixed_parts.h"

#include <optional>
#include <string>

#include "krot/model/image_geometry.h"
#include "krot/model/name_list.h"

namespace krot::internal {

std::vector<char> FixedFrames(const FileBytes& file, const Model& model,
                              const FileNote& note) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  ListReader list(file, model, ListReader::Of::kImagesOrIds);
  std::vector<char> is_fixed(model.frames.size(), 0);
  while (list.Next()) {
    const std::optional<int32_t> image = list.TakeName();
    if (!image) continue;
    if (!geometries[*image].has_pose) {
      list.reader().Fail("\"" + model.images[*image].name +
                             "\", which stands nowhere in the model",
                         "an image with a pose");
    }
    is_fixed[geometries[*image].frame] = 1;
  }
  list.Finish(note);
  return is_fixed;
}

std::vector<char> FixedPoints3D(const FileBytes& file, const Model& model,
                                const FileNote& note) {
  ListReader list(file, model, ListReader::Of::kPoints3D);
  std::vector<char> is_fixed(model.points3D.size(), 0);
  while (list.Next()) {
    if (const auto point = list.TakeName()) is_fixed[*point] = 1;
  }
  list.Finish(note);
  return is_fixed;
}

}  // namespace krot::internal
