#include "krot/model/fixed_parts.h"

#include <optional>
#include <string>
#include <string_view>

#include "krot/model/id_index.h"
#include "krot/model/image_geometry.h"
#include "krot/model/image_names.h"
#include "krot/model/model_error.h"
#include "krot/model/text_reader.h"

namespace krot {
namespace {

// Hands every line of the file to `mark`, as text.
template <typename Mark>
void MarkLines(const FileBytes& file, const char* expected, const Mark& mark) {
  TextReader reader(file);
  bool is_empty = true;
  while (reader.NextRecord()) {
    is_empty = false;
    mark(reader.Rest(), reader);
  }
  if (is_empty) {
    throw ModelError(file.path + ": found no line, expected " + expected);
  }
}

}  // namespace

std::vector<char> FixedFrames(const FileBytes& file, const Model& model) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const ImageNames names(model);
  const IdIndex<ImageId> ids(model.images);
  std::vector<char> is_fixed(model.frames.size(), 0);
  MarkLines(
      file, "the name or the id of an image on each",
      [&](std::string_view text, const TextReader& reader) {
        std::optional<int32_t> image;
        if (names.Has(text)) {
          image = names.Find(text, reader);
        } else if (const auto id = TextReader::ParseNumber<ImageId>(text)) {
          image = ids.Find(*id);
        }
        if (!image) {
          reader.Fail("\"" + std::string(text) + "\"",
                      "the name or the id of an image of the model");
        }
        const int32_t frame = geometries[*image].frame;
        if (!model.frames[frame].rig_from_world.translation.allFinite()) {
          reader.Fail("\"" + std::string(text) +
                          "\", which stands nowhere in the model",
                      "an image with a finite translation");
        }
        is_fixed[frame] = 1;
      });
  return is_fixed;
}

std::vector<char> FixedPoints3D(const FileBytes& file, const Model& model) {
  const IdIndex<Point3DId> ids(model.points3D);
  std::vector<char> is_fixed(model.points3D.size(), 0);
  MarkLines(file, "the id of a 3D point on each",
            [&](std::string_view text, const TextReader& reader) {
              const auto id = TextReader::ParseNumber<Point3DId>(text);
              const std::optional<int32_t> point =
                  id ? ids.Find(*id) : std::nullopt;
              if (!point) {
                reader.Fail("\"" + std::string(text) + "\"",
                            "the id of a 3D point of the model");
              }
              is_fixed[*point] = 1;
            });
  return is_fixed;
}

}  // namespace krot
