#pragma once

#include <optional>
#include <string>
#include <utility>

#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/model/model_checks.h"
#include "krot/model/model_io.h"

namespace krot::internal {

// What to do with a model whose tracks and images contradict each other. By
// `on_contradiction`:
//   "auto": the side that fits the model's own positions is followed (kTracks,
//     kImages). A side fits whose median error is at most a tenth of the
//     image's larger side and at most twice the other's and a pixel. Where both
//     fit, or nothing is to be measured (no positions, no tracks), it is kBoth,
//     unless a side alone has half of its observations at least and a smaller
//     largest error. Then the model agrees with itself. Where neither fits the
//     model stays as it is, and `followed` is "neither";
//   "follow_images": kImages;
//   "follow_tracks", "refuse": the model stays as it is.
// Returns what was found. A model without contradictions stays as it is, and
// `followed` is "". Throws ModelError where the model is invalid but for its
// tracks and std::invalid_argument for other values. Holds up to three copies
// of a model that contradicts itself. O(size of the model).
Contradictions SettleContradictions(const std::string& on_contradiction,
                                    Model* model);

// The largest error by the images' side, pixels in the p-norm, before and after
// a change of positions: of a model that contradicts itself, whose images' side
// fitted (by its median, as above) and is worse now. None otherwise.
// O(size of the model).
std::optional<std::pair<double, double>> WorseImagesSide(const Model& before,
                                                         const Model& after,
                                                         Norm norm = {});

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
