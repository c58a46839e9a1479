// COLMAP's five binary files: what is read is written again byte for byte.

#include <iterator>

#include "krot/context.h"
#include "krot/model/formats.h"
#include "tests/fuzz/fuzz.h"

namespace krot::internal {
namespace {

struct Part {
  void (*parse)(const FileBytes& file, Model* model);
  std::string (*format)(const Model& model);
};

constexpr Part kParts[] = {
    {ParseCamerasBinary, FormatCamerasBinary},
    {ParseRigsBinary, FormatRigsBinary},
    {ParseFramesBinary, FormatFramesBinary},
    {ParseImagesBinary, FormatImagesBinary},
    {ParsePoints3DBinary, FormatPoints3DBinary},
};

void Read(ByteSource source) {
  const Part& part = kParts[source.Byte() % std::size(kParts)];
  const FileBytes file = source.Rest("file");
  Model model;
  try {
    part.parse(file, &model);
  } catch (const ModelError&) {
    return;
  }
  // A rig without sensors has no room for anything else.
  Require(part.format(model) == file.bytes, "written as it was read");
}

}  // namespace
}  // namespace krot::internal

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  krot::internal::Read({data, size});
  return 0;
}
