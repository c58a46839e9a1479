// lower_largest_error INPUT_FOLDER OUTPUT_FOLDER: a COLMAP model with its
// largest reprojection error as low as its rotations allow.

#include <cstdio>
#include <exception>

#include "krot/model/model_io.h"
#include "krot/model/validate.h"
#include "krot/pipeline/solve_model.h"
#include "krot/version.h"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "Usage: %s INPUT_FOLDER OUTPUT_FOLDER\n", argv[0]);
    return 1;
  }
  try {
    const krot::ModelFormat format = krot::DetectModelFormat(argv[1]);
    const krot::Model model = krot::ReadModel(argv[1], format);
    krot::ValidateModel(model);

    const krot::SolveModelResult result = krot::SolveModel(model, {});

    krot::WriteModelOptions options;
    options.format = format;
    krot::WriteModel(result.model, argv[2], options);
    const krot::SolveSummary& summary = result.summary;
    std::printf("KROT " KROT_VERSION ": largest error %.4f -> %.4f px",
                summary.pixel_error_before.max, summary.pixel_error_after.max);
    if (summary.lower_bound) {
      std::printf("; none below %.4f px is possible", *summary.lower_bound);
    }
    std::printf("\n");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
