// find_wrong INPUT_FOLDER OUTPUT_FOLDER: which images and observations of a
// model contradict the others, and the model without them.

#include <cstdio>
#include <exception>

#include "krot/check.h"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "Usage: %s INPUT_FOLDER OUTPUT_FOLDER\n", argv[0]);
    return 1;
  }
  try {
    const krot::Model model = krot::ReadModel(argv[1]);
    const krot::ModelCheck check = krot::CheckModel(model);
    if (!check.sigma_px) {
      std::printf("nothing is checked by anything else\n");
      return 0;
    }
    std::printf("noise %.3f px; %zu of %lld observations are more than that\n",
                *check.sigma_px, check.observations.size(),
                static_cast<long long>(check.num_tested));
    for (const krot::ImageCheck& image : check.images) {
      if (image.verdict != krot::ImageVerdict::kWrong) continue;
      std::printf("%s is wrong: %lld of %lld observations contradict others\n",
                  image.name.c_str(), static_cast<long long>(image.num_wrong),
                  static_cast<long long>(image.num_tested));
    }
    krot::WriteModel(krot::CureModel(model, check).model, argv[2]);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
