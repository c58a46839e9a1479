#include "krot/report/pair_report.h"

#include "krot/report/report_json.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

double MeanTrackLength(const TrackReport& report) {
  return report.num_points == 0 ? 0
                                : static_cast<double>(report.num_observations) /
                                      static_cast<double>(report.num_points);
}

}  // namespace

std::string TrackSentence(const TrackReport& report) {
  return Thousands(report.num_points) + " points with " +
         Thousands(report.num_observations) + " observations: tracks of " +
         FormatNumber(MeanTrackLength(report), 2) +
         " images, root mean square error " +
         FormatNumber(report.pixel_error.rms, 3) + " px.";
}

std::string TrackTable(const TrackReport& report) {
  const MatchTracksSummary& summary = report.summary;
  std::string text = TrackSentence(report) + "\n\n";
  TextTable table;
  const auto add = [&](const char* what, int64_t count) {
    table.AddRow({what, Thousands(count)});
  };
  add("pairs of images whose matches are used", summary.num_pairs);
  add("their matches", summary.num_matches);
  add("of these, that contradict the poses", summary.num_disagreeing);
  add("tracks that the others join", summary.num_components);
  add("of these, with an image twice", summary.num_image_twice);
  add("divided, as no point fits all", summary.num_in_conflict);
  add("left out, as they are a single match", summary.num_two_views);
  add("left out, as their rays are too narrow", summary.num_narrow);
  text += table.ToString();
  if (summary.num_contradictory_pairs > 0) {
    text += "\nThe matches of " +
            Counted(summary.num_contradictory_pairs, "other pair") +
            " contradict the poses and are not used; krot model_checker "
            "--database_path\nsays whether images are wrong or matches.\n";
  }
  return text + "\n" +
         RunSentence(report.run,
                     "triangulated " +
                         FormatNumber(report.seconds_triangulate, 2) + " s");
}

Json MatchesJson(const MatchTracksSummary& summary) {
  return {{"num_pairs", summary.num_pairs},
          {"num_contradictory_pairs", summary.num_contradictory_pairs},
          {"num_matches", summary.num_matches},
          {"num_disagreeing_matches", summary.num_disagreeing},
          {"num_components", summary.num_components},
          {"num_image_twice", summary.num_image_twice},
          {"num_in_conflict", summary.num_in_conflict},
          {"num_two_views", summary.num_two_views},
          {"num_narrow", summary.num_narrow}};
}

std::string MatchesSentence(const MatchTracksSummary& summary) {
  return "The points come from the matches of " +
         Counted(summary.num_pairs, "pair") + " of images" +
         (summary.num_contradictory_pairs > 0
              ? "; those of " +
                    Counted(summary.num_contradictory_pairs, "other pair") +
                    " contradict the positions and are not used"
              : std::string()) +
         ".\n";
}

std::string TrackJson(const TrackReport& report) {
  Json json = {
      {"version", report.run.version},
      {"command", "point_triangulator"},
      {"verdict", TrackSentence(report)},
      {"num_points", report.num_points},
      {"num_observations", report.num_observations},
      {"mean_track_length", MeanTrackLength(report)},
      {"pixel_error", ErrorJson(report.pixel_error)},
  };
  json.update(MatchesJson(report.summary));
  return ReportText(json, report.run,
                    {{"triangulate", report.seconds_triangulate}});
}

}  // namespace krot::internal
