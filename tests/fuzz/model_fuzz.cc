// The five binary files of one model together, each after its size: what passes
// validation can be analysed, digested and made into a problem.

#include <algorithm>
#include <array>

#include "krot/context.h"
#include "krot/convert/build_problem.h"
#include "krot/convert/certificate_file.h"
#include "krot/model.h"
#include "krot/model/formats.h"
#include "krot/model/model_checks.h"
#include "krot/model/rigs.h"
#include "tests/fuzz/fuzz.h"

namespace krot::internal {
namespace {

using Parse = void (*)(const FileBytes& file, Model* model);

Model ReadParts(ByteSource source) {
  Model model;
  std::string bytes = source.Rest("").bytes;
  constexpr std::array<Parse, 5> kParts = {ParseCamerasBinary, ParseRigsBinary,
                                           ParseFramesBinary, ParseImagesBinary,
                                           ParsePoints3DBinary};
  for (const Parse parse : kParts) {
    size_t size = 0;
    if (bytes.size() >= 2) {
      size = static_cast<uint8_t>(bytes[0]) +
             256u * static_cast<uint8_t>(bytes[1]);
      bytes.erase(0, 2);
    }
    size = std::min(size, bytes.size());
    parse({"file", bytes.substr(0, size)}, &model);
    bytes.erase(0, size);
  }
  model.stores_rigs = !model.rigs.empty() || !model.frames.empty();
  if (!model.stores_rigs) UseTrivialRigs(&model);
  return model;
}

void Use(const Model& model) {
  ValidateModel(model);
  Require(PixelErrors(model, 1).size() == model.track_elements.size(),
          "an error of every observation");
  Require(ModelSha256(model).size() == 64, "a digest");
  BuildProblem(model, {});
}

void Read(ByteSource source) {
  try {
    Model model = ReadParts(source);
    FindContradictions(model);
    Use(model);
    Follow(Reading::kImages, &model);
    Use(model);
  } catch (const ModelError&) {
  }
}

}  // namespace
}  // namespace krot::internal

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  krot::internal::Read({data, size});
  return 0;
}
