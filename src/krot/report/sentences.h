#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "krot/analysis/collapse.h"
#include "krot/analysis/model_input.h"
#include "krot/base/context.h"
#include "krot/model/model_checks.h"
#include "krot/pipeline/solve_model.h"
#include "krot/report/text_table.h"

namespace krot::internal {

// What a model of poses alone lacks, and where it comes from.
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

// " contradicts itself: ...", behind the model's path: how often, how both
// sides fit the model's own positions, and what is followed.
std::string ContradictionSentence(const Contradictions& contradictions);

// Throws ModelError where the model at `path` is not to be read as neither side
// fits.
void RequireSettled(const std::string& path,
                    const Contradictions& contradictions);

// "by the images' side, which COLMAP's bundle adjustment reads, the largest
// error rises from 1.0973 px to 131.9991 px": before and after, pixels.
std::string WorseImagesWords(const std::pair<double, double>& max_px);

// "the errors fall only where all 1721 points that two cameras see lie in one
// place, so that nothing is left of the scene". Requires IsWhole().
std::string WholeCollapseWords(const Collapse& collapse);

// What came to lie in cameras and at infinity, one line each; "" if nothing.
std::string CollapseLines(const Collapse& collapse);

// "point3D_id 5, 17, 9, ...".
std::string PointList(const std::vector<Point3DId>& points);

// "2 frames, 4 images, 1 point, 8 observations", of a summary with these
// counts.
template <typename Summary>
std::string CountsWords(const Summary& summary) {
  return Counted(summary.num_frames, "frame") + ", " +
         Counted(summary.num_images, "image") + ", " +
         Counted(summary.num_points, "point") + ", " +
         Counted(summary.num_observations, "observation");
}

// What does not hold its place, and what became of that, of so many images: a
// line for each kind, that ends in '\n'; empty where everything holds it.
std::string LooseSentences(const LooseParts& loose, int64_t num_images);

// What a user should know of the poses that were read; empty if nothing is odd.
std::vector<std::string> PoseSentences(const PoseChecks& poses);

// What the rotations of the file `path` did; begins with "warning: " where they
// are probably wrong.
std::string RotationsSentence(const std::string& path,
                              const RotationInput& input);

// What every run that solves for a model records beside its result.
struct RunRecord {
  std::string version;            // KROT's
  Contradictions contradictions;  // of the input
  PoseChecks poses;               // likewise
  // Where the input's rotations were not its own.
  std::optional<RotationInput> rotations;
  double seconds_read = 0;  // wall clock
  double seconds_write = 0;
  double seconds_total = 0;
  int64_t peak_memory_bytes = 0;
  int threads = 0;
  uint64_t seed = 0;
};

// Version, threads, the time since the timer was made, the process's memory.
void RecordEnd(const Timer& timer, int num_threads, RunRecord* run);

// "Read 0.10 s, MIDDLE, wrote 0.20 s; 1.50 s in all on 2 threads, ...\n".
std::string RunSentence(const RunRecord& run, const std::string& middle);

}  // namespace krot::internal
