#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/model/model_checks.h"
#include "krot/model/model_io.h"
#include "krot/model/rigs.h"

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

// ---- Known positions ----

// Positions in a frame of their own (metres of a survey, UTM, a receiver's):
// the similarity from the model's frame to it, and which positions are wrong.

// A position that does not agree with the others.
struct WrongPosition {
  size_t index = 0;     // in the list of positions
  std::string name;     // "a.jpg" or "3D point 12"
  double distance = 0;  // from the model's place; units of the positions
  double radius = 0;    // the position's, in that direction
};

std::string NameOf(const Model& model, const KnownPosition& position);

// Where the model has it; none if that is not known.
std::optional<Eigen::Vector3d> PlaceOf(const Model& model,
                                       const std::vector<ImageGeometry>& images,
                                       const KnownPosition& position);

struct PositionFrame {
  Similarity own_from_model;
  // In the model's frame and unit: all but the wrong ones.
  std::vector<KnownPosition> positions;
  std::vector<WrongPosition> wrong;  // farthest first
  int64_t num_compared = 0;          // whose camera or point the model places
  double median_distance = 0;        // of those that agree; their units
  // A position is wrong beyond so many radii. Above 1 where the model and the
  // positions differ by more than the radii say.
  double tolerance = 1;
  // The radius of positions that came without one, from their scatter.
  std::optional<double> radius;
};

// Finds the similarity that the largest part of the positions agrees with,
// within their radii. Candidates take three of the model's places to their
// positions [Umeyama 1991]: all triples or, where there are more, 50,000 of
// them, always the same. The best one has the least sum of squared distances in
// radii, none of which counts for more than 1; it is refined on the positions
// that agree. Where no majority agrees within its radii, or radii are unknown
// (zero), the one with the least median is taken. A position is wrong if it is
// farther off than its radius and than 2.6 times the median (more, of few
// positions).
//
// Requires a valid model. Throws ModelError, which begins with `source`, for
// fewer than three positions of what the model places, for positions on a line,
// up to their scatter, about which the model could be turned, and for positions
// that have nothing to do with the model. The same at any number of threads.
// O(positions), with at most 50,000 triples on 300 of them.
PositionFrame FindPositionFrame(const Model& model,
                                const std::vector<KnownPosition>& positions,
                                const std::string& source);

// The positions that agree, in their own frame and unit again.
std::vector<KnownPosition> InOwnFrame(const PositionFrame& frame);

// Files of known positions: docs/formats.md, "Positions".
struct PositionFiles {
  std::string of_cameras;  // "": none
  std::string of_points;
  bool have_own_frame = false;
  std::optional<double> radius;  // of lines that have none
};

struct KnownPositions {
  std::vector<KnownPosition> positions;  // in the model's frame
  std::optional<PositionFrame> frame;    // the files' own frame, if any
};

// Throws ModelError.
KnownPositions ReadKnownPositions(const PositionFiles& files,
                                  const Model& model,
                                  const FileNote& on_note = {});

}  // namespace krot::internal
