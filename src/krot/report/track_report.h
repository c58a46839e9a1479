#pragma once

#include <cstdint>
#include <string>

#include "krot/model.h"
#include "krot/outliers/match_tracks.h"
#include "krot/report/run_record.h"

namespace krot::internal {

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

// report.json; the keys are listed in docs/cli.md.
std::string TrackJson(const TrackReport& report);

}  // namespace krot::internal
