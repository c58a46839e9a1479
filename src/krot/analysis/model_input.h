#pragma once

#include <optional>
#include <string>
#include <utility>

#include "krot/math/norm.h"
#include "krot/model.h"
#include "krot/model/model_checks.h"
#include "krot/model/model_io.h"

namespace krot::internal {

// What to do with a model whose tracks and images contradict each other, by
// `on_contradiction`:
//   "auto": the side that fits the model's own positions is followed (kTracks,
//     kImages). A side fits if its median error is at most a tenth of the
//     image's larger side, and at most twice the other side's plus a pixel.
//     Where both fit, or nothing can be measured (no positions, no tracks), it
//     is kBoth, unless a side alone has at least half of the observations and a
//     smaller largest error. In all these cases the model agrees with itself
//     afterwards. Where neither fits, the model stays as it is, and `followed`
//     is "neither";
//   "follow_images": kImages;
//   "follow_tracks", "refuse": the model stays as it is.
// Returns what was found. A model without contradictions stays as it is, and
// `followed` is "". Throws ModelError if the model is invalid apart from its
// tracks, and std::invalid_argument for other values. Holds up to three copies
// of a model that contradicts itself. O(size of the model).
Contradictions SettleContradictions(const std::string& on_contradiction,
                                    Model* model);

// Whether a change of positions made the images' side of a model worse that
// contradicts itself: its largest errors before and after, pixels in the
// p-norm. None if it did not, if that side did not fit before (by its median,
// as above), or if there is no contradiction. O(size of the model).
std::optional<std::pair<double, double>> WorseImagesSide(const Model& before,
                                                         const Model& after,
                                                         Norm norm = {});

// The rotations of a file that replaced the model's own, and how its errors
// changed by that while cameras and points stayed.
struct RotationInput {
  ReplacedRotations replaced;
  // The median pixel error of the observations of images that turned, or of all
  // if none did. Observations without a finite error count as the largest; none
  // if the median is one of these.
  std::optional<double> median_error_before;
  std::optional<double> median_error_after;
};

// ReplaceRotations, which tells `note` what it skips. Throws ModelError if the
// file probably has a mistake of convention (ReplacedRotations::mistake) and
// the model's errors say so, too: with its own rotations the median error is
// small, at most 1 % of the largest image's larger side, and far smaller than
// with the file's. O(observations).
RotationInput TakeRotations(const FileBytes& file, Model* model,
                            int num_threads = -1, const FileNote& note = {});

}  // namespace krot::internal
