#include "krot/model/validate.h"
#include "krot/synthetic/scene.h"

int main() {
  const krot::SyntheticScene scene = krot::SynthesizeScene({});
  krot::ValidateModel(scene.model);
  return scene.model.images.size() == 20 ? 0 : 1;
}
