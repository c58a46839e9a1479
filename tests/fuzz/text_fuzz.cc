// COLMAP's five text files: what is read, written and read again is the same.

#include <iterator>

#include "krot/base/write_file.h"
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
    {ParseCamerasText, FormatCamerasText},
    {ParseRigsText, FormatRigsText},
    {ParseFramesText, FormatFramesText},
    {ParseImagesText, FormatImagesText},
    {ParsePoints3DText, FormatPoints3DText},
};

void Read(ByteSource source) {
  const Part& part = kParts[source.Byte() % std::size(kParts)];
  Model model;
  std::string text;
  try {
    part.parse(source.Rest("file"), &model);
    text = part.format(model);
  } catch (const ModelError&) {
    return;
  } catch (const WriteError&) {
    return;  // a sensor type that text has no name for
  }
  Model again;
  part.parse({"file", text}, &again);
  Require(part.format(again) == text, "written as it was read");
}

}  // namespace
}  // namespace krot::internal

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  krot::internal::Read({data, size});
  return 0;
}
