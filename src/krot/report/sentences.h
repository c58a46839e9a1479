#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "krot/analysis/model_comparison.h"
#include "krot/analysis/model_input.h"
#include "krot/analysis/model_statistics.h"
#include "krot/base/context.h"
#include "krot/check.h"
#include "krot/model/model_checks.h"
#include "krot/pipeline/solve_model.h"
#include "krot/report/text_table.h"

namespace krot::internal {

// What a model without observations lacks, and how to get it.
inline constexpr char kNoObservations[] =
    "the model has no observations (2D points that see 3D points); krot "
    "point_triangulator makes them from its poses and a database of matches";

// Observations left out, by reason.
using LeftOutCounts = std::vector<std::pair<std::string, int64_t>>;

// "15 observations left out (short_track 12, behind 3)"; reasons without an
// observation are not listed.
std::string LeftOutWords(const LeftOutCounts& left_out);

// "nothing to solve: 15 observations left out (...)" for `what` = "solve".
std::string NothingToDoSentence(const std::string& what,
                                const LeftOutCounts& left_out);

// The rest of a sentence that begins with the model's path, " contradicts
// itself: ...": how often, how well both statements fit the model's own
// positions, and which one is followed.
std::string ContradictionSentence(const Contradictions& contradictions);

// Throws ModelError if neither of the two statements fits, so the model at
// `path` must not be read without the user's choice.
void RequireSettled(const std::string& path,
                    const Contradictions& contradictions);

// For example "by the images' side, which COLMAP's bundle adjustment reads, the
// largest error rises from 1.0973 px to 131.9991 px". `max_px`: before and
// after, pixels.
std::string WorseImagesWords(const std::pair<double, double>& max_px);

// These name the first camera that COLMAP's mapper would discard and what to
// do, the images that nothing can check, and pairs that are the same photo; ""
// without any.
std::string DiscardedSentence(const std::vector<DiscardedCamera>& discarded);
std::string NotJudgedSentence(const ModelCheck& check);
std::string SamePhotosSentence(const ModelCheck& check);

// Requires still points. What then comes next, for photos at this path.
std::string StillPointsSentence(const ModelCheck& check);
std::string MaskSteps(const std::string& images);

// Whether a camera is wrong in a way that no adjustment mends: in its model, or
// in what shares it. What then comes next, in commands of COLMAP and KROT, with
// these paths.
bool NeedsOtherCameras(const ModelCheck& check);
std::string OtherCameraSteps(const ModelCheck& check, const std::string& input,
                             const std::string& images);

// Says that the largest error has risen, and why, where observations were left
// out; "" if it has not.
std::string RaisedMaxSentence(const PixelErrorStatistics& before,
                              const PixelErrorStatistics& after);

// For example "the errors fall only where all 1721 points that two cameras see
// lie in one place, so that nothing is left of the scene". Requires IsWhole().
std::string WholeCollapseWords(const Collapse& collapse);

// The points that fell into cameras, and those that went to infinity, one line
// each; "" if there are none.
std::string CollapseLines(const Collapse& collapse);

// "point3D_id 5, 17, 9, ...".
std::string PointList(const std::vector<Point3DId>& points);

// For example "2 frames, 4 images, 1 point, 8 observations".
template <typename Summary>
std::string CountsWords(const Summary& summary) {
  return Counted(summary.num_frames, "frame") + ", " +
         Counted(summary.num_images, "image") + ", " +
         Counted(summary.num_points, "point") + ", " +
         Counted(summary.num_observations, "observation");
}

// A line for each kind of images and points that do not hold their place, with
// what was done about them; each ends in '\n'. Empty if all hold it.
// `num_images` is the number of all images.
std::string LooseSentences(const LooseParts& loose, int64_t num_images);

// A sentence for each suspicious property of the poses; empty if there is none.
std::vector<std::string> PoseSentences(const PoseChecks& poses);

// What the file of rotations at `path` changed; begins with "warning: " if its
// rotations are probably wrong.
std::string RotationsSentence(const std::string& path,
                              const RotationInput& input);

// What every run that solves for a model records beside its result.
struct RunRecord {
  std::string version;            // KROT's
  Contradictions contradictions;  // of the input
  PoseChecks poses;               // likewise
  // Set if the rotations come from a file, not from the model.
  std::optional<RotationInput> rotations;
  double seconds_read = 0;  // wall clock
  double seconds_write = 0;
  double seconds_total = 0;
  int64_t peak_memory_bytes = 0;
  int threads = 0;
  uint64_t seed = 0;
};

// Records version, threads, the time since the timer was made, and the memory
// of the process.
void RecordEnd(const Timer& timer, int num_threads, RunRecord* run);

// "Read 0.10 s, MIDDLE, wrote 0.20 s; 1.50 s in all on 2 threads, ...\n".
std::string RunSentence(const RunRecord& run, const std::string& middle);

}  // namespace krot::internal
