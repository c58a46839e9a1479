// solve_folder INPUT_FOLDER OUTPUT_FOLDER: a COLMAP model with its largest
// reprojection error as low as its rotations allow.

#include <cstdio>
#include <exception>

#include "krot/model.h"
#include "krot/solve.h"
#include "krot/version.h"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "Usage: %s INPUT_FOLDER OUTPUT_FOLDER\n", argv[0]);
    return 1;
  }
  try {
    const krot::Model model = krot::ReadModel(argv[1]);
    const krot::SolveResult result = krot::Solve(model);
    krot::WriteModel(result.model, argv[2]);

    std::printf("KROT " KROT_VERSION ": largest error %.4f -> %.4f px",
                result.errors_before.max, result.errors_after.max);
    if (result.lower_bound) {
      std::printf("; none below %.4f px is possible", *result.lower_bound);
    }
    std::printf("\n");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
