#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "krot/pipeline/settle.h"
#include "krot/report/text_table.h"

namespace krot {

// What a model of poses alone lacks, and where it comes from.
inline constexpr char kNoObservations[] =
    "the model has no observations (2D points that see 3D points); colmap "
    "point_triangulator makes them from its poses and a database of matches";

// Observations left out, by reason.
using LeftOutCounts = std::vector<std::pair<std::string, int64_t>>;

// "15 observations left out (short_track 12, behind 3)"; reasons without an
// observation are not listed.
std::string LeftOutWords(const LeftOutCounts& left_out);

// "nothing to solve: 15 observations left out (...)" for `what` = "solve".
std::string NothingToDoSentence(const std::string& what,
                                const LeftOutCounts& left_out);

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

}  // namespace krot
