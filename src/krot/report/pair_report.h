#pragma once

#include <cstdint>
#include <string>

#include "krot/database.h"
#include "krot/model.h"
#include "krot/outliers/match_tracks.h"
#include "krot/report/report_json.h"
#include "krot/report/sentences.h"

namespace krot::internal {

// Reports on what the matches of a database say about a model's poses.

// For example "By the matches 39 of 249 pairs of images contradict the poses: 3
// images are wrong."
std::string PairSentence(const PairCheck& check);

// What is wrong with an image's pose: "rotation: turned by 0.31 degrees".
std::string PoseFaultWords(const CheckedImage& image);

// For the terminal: PairSentence, wrong images and pairs with wrong matches, at
// most max_rows of each.
std::string PairTable(const PairCheck& check, int max_rows);

// The same as an object for report.json; docs/cli.md lists its keys.
Json PairJson(const PairCheck& check);

// What the page draws of the matches. `images` are in the order of the report:
// their width and height on the page, and jpeg, which is null until a photo is
// added. `matches` lists up to 100 matches of each pair (of kept pairs 30),
// evenly chosen from all: x and y in both images, and 1 if the match agrees
// with the poses, otherwise 0. `check` must be CheckPairs' of the model and the
// database. O(matches).
Json PairViewJson(const Model& model, const Database& database,
                  const PairCheck& check);

// What one run of `krot point_triangulator --database_path` produced.
struct TrackReport {
  RunRecord run;
  MatchTracksSummary summary;
  int64_t num_points = 0;
  int64_t num_observations = 0;
  PixelErrorStatistics pixel_error;
  double seconds_triangulate = 0;  // wall clock
};

// For example "9,128 points with 52,311 observations: tracks of 5.73 images,
// root mean square error 0.71 px."
std::string TrackSentence(const TrackReport& report);

// For the terminal: TrackSentence, and what became of the matches.
std::string TrackTable(const TrackReport& report);

// The same numbers for report.json.
Json MatchesJson(const MatchTracksSummary& summary);

// For example "The points come from the matches of 249 pairs of images."
std::string MatchesSentence(const MatchTracksSummary& summary);

// report.json; docs/cli.md lists its keys.
std::string TrackJson(const TrackReport& report);

}  // namespace krot::internal
