// The lists beside a model: rotations, positions, and what must not move.

#include "krot/context.h"
#include "krot/model.h"
#include "krot/model/model_io.h"
#include "tests/fuzz/fuzz.h"

namespace krot::internal {
namespace {

void Read(ByteSource source) {
  static const Model model = FuzzScene().model;
  const uint8_t kind = source.Byte();
  const FileBytes file = source.Rest("file");
  try {
    switch (kind % 5) {
      case 0: {
        Model turned = model;
        ReplaceRotations(file, &turned);
        ValidateModel(turned);
        break;
      }
      case 3:
        for (const KnownPosition& position : ReadPositions(file, model)) {
          Require(IsFit(position.region), "a region with an inside");
        }
        break;
      case 4:
        for (const KnownPosition& position : ReadPointPositions(file, model)) {
          Require(IsFit(position.region), "a region with an inside");
        }
        break;
      case 1:
        Require(FixedFrames(file, model).size() == model.frames.size(),
                "a flag of every frame");
        break;
      default:
        Require(FixedPoints3D(file, model).size() == model.points3D.size(),
                "a flag of every point");
        break;
    }
  } catch (const ModelError&) {
  }
}

}  // namespace
}  // namespace krot::internal

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  krot::internal::Read({data, size});
  return 0;
}
