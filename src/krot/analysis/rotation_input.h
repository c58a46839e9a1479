#pragma once

#include <optional>

#include "krot/model.h"
#include "krot/model/file_bytes.h"
#include "krot/model/rotations_file.h"

namespace krot::internal {

// The rotations of a file in place of the model's own, and what that does to
// its errors while cameras and points stay where they are.
struct RotationInput {
  ReplacedRotations replaced;
  // The median pixel error of the observations of images that turn, those
  // without a finite one at the upper end; none where it is one of these. Of
  // all observations where none turns.
  std::optional<double> median_error_before;
  std::optional<double> median_error_after;
};

// ReplaceRotations, which tells `note` what it skips. Throws ModelError where
// the file is a mistake of convention, probably (ReplacedRotations::mistake),
// and the model's errors say so, too: with its own rotations the median is
// small, at most 1 % of the largest image's larger side, and far smaller.
// O(observations).
RotationInput TakeRotations(const FileBytes& file, Model* model,
                            int num_threads = -1, const FileNote& note = {});

}  // namespace krot::internal
