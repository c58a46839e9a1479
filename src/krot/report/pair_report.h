#pragma once

#include <cstdint>
#include <string>

#include "krot/database.h"
#include "krot/model.h"
#include "krot/outliers/match_tracks.h"
#include "krot/report/report_json.h"
#include "krot/report/sentences.h"

namespace krot::internal {

// What the matches of a database say of a model's poses.

// "By the matches 39 of 249 pairs of images contradict the poses: 3 images are
// wrong."
std::string PairSentence(const PairCheck& check);

// Of a wrong image: "rotation: turned by 0.31 degrees".
std::string PoseFaultWords(const CheckedImage& image);

// For the terminal: the sentence, wrong images and pairs with wrong matches, at
// most max_rows of each.
std::string PairTable(const PairCheck& check, int max_rows);

// An object; docs/cli.md has its keys.
Json PairJson(const PairCheck& check);

// Images on the report page: their longer side, pixels.
inline constexpr int kPairViewSide = 480;

// What the page draws of the matches of pairs of images. `images`, in the order
// of the report's: width and height there, and jpeg, null until a photo comes.
// `matches`, of each pair a list of up to 100 (of kept pairs 30), evenly from
// all: x and y in both images, and 1 if the match agrees with the poses, else
// 0. `check` is CheckPairs' of the two. O(matches).
Json PairViewJson(const Model& model, const Database& database,
                  const PairCheck& check);

// What one run of `krot point_triangulator --database_path` made.
struct TrackReport {
  RunRecord run;
  MatchTracksSummary summary;
  int64_t num_points = 0;
  int64_t num_observations = 0;
  PixelErrorStatistics pixel_error;
  double seconds_triangulate = 0;  // wall clock
};

// "9,128 points with 52,311 observations of 25 images: tracks of 5.73 images,
// root mean square error 0.71 px."
std::string TrackSentence(const TrackReport& report);

// For the terminal: the sentence, and what became of the matches.
std::string TrackTable(const TrackReport& report);

// Their numbers, for report.json.
Json MatchesJson(const MatchTracksSummary& summary);

// "The points come from the matches of 249 pairs of images."
std::string MatchesSentence(const MatchTracksSummary& summary);

// report.json; the keys are listed in docs/cli.md.
std::string TrackJson(const TrackReport& report);

}  // namespace krot::internal
