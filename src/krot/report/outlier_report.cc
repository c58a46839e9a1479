#include "krot/report/outlier_report.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <vector>

#include "krot/outliers/robust_start.h"
#include "krot/report/csv_text.h"
#include "krot/report/error_rows.h"
#include "krot/report/report_json.h"
#include "krot/report/solve_report.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

constexpr size_t kShownSuspects = 5;

Json RemovedJson(const std::vector<RemovedObservation>& removed) {
  Json json = Json::array();
  for (const RemovedObservation& o : removed) {
    json.push_back({{"image_id", o.image_id},
                    {"image_name", o.image_name},
                    {"point2D_idx", o.point2D_idx},
                    {"point3D_id", o.point3D_id},
                    {"error_before_px", FiniteOrNull(o.error_before_px)},
                    {"error_after_px", FiniteOrNull(o.error_after_px)},
                    {"conflict", o.conflict ? Json(*o.conflict) : Json()},
                    {"w", o.w ? FiniteOrNull(*o.w) : Json()}});
  }
  return json;
}

// The share of the conflicts that would vanish without it.
Json ConflictShare(int64_t num_conflicts, const OutlierFilterSummary& summary) {
  if (summary.num_proved == 0) return {};
  return static_cast<double>(num_conflicts) /
         static_cast<double>(summary.num_proved);
}

Json SuspectsJson(const std::vector<Suspect>& suspects, const char* id,
                  const OutlierFilterSummary& summary) {
  Json json = Json::array();
  for (const Suspect& suspect : suspects) {
    Json one = {{id, suspect.id}};
    if (!suspect.name.empty()) one["image_name"] = suspect.name;
    one["num_observations"] = suspect.num_observations;
    one["num_removed"] = suspect.num_removed;
    one["num_conflicts"] = suspect.num_conflicts;
    one["conflict_share"] = ConflictShare(suspect.num_conflicts, summary);
    json.push_back(std::move(one));
  }
  return json;
}

Json RotationSuspectJson(const OutlierFilterSummary& summary) {
  if (!summary.rotation_suspect) return {};
  const RotationSuspect& suspect = *summary.rotation_suspect;
  return {{"image_id", suspect.image_id},
          {"image_name", suspect.image_name},
          {"num_conflicts", suspect.num_conflicts},
          {"conflict_share", ConflictShare(suspect.num_conflicts, summary)},
          {"angle_deg", suspect.angle_deg},
          {"axis_in_cam",
           {suspect.axis_in_cam.x(), suspect.axis_in_cam.y(),
            suspect.axis_in_cam.z()}},
          {"num_observations", suspect.num_observations},
          {"num_above", suspect.num_above},
          {"num_above_turned", suspect.num_above_turned},
          {"lower_bound_with", suspect.lower_bound_with},
          {"max_error_without", suspect.max_error_without}};
}

std::string RotationSentence(const OutlierFilterSummary& summary) {
  if (!summary.rotation_suspect) return "";
  const RotationSuspect& suspect = *summary.rotation_suspect;
  return "\nConflicts gather in " + suspect.image_name + " (" +
         std::to_string(suspect.num_conflicts) + " of " +
         std::to_string(summary.num_proved) +
         "): its rotation is the suspect. Turned by " +
         FormatNumber(suspect.angle_deg, 3) + " degrees it has " +
         std::to_string(suspect.num_above_turned) + " instead of " +
         std::to_string(suspect.num_above) + " of " +
         Counted(suspect.num_observations, "observation") +
         " above the bound.\nWith it no translations and points bring all "
         "errors below " +
         FormatNumber(suspect.lower_bound_with, 4) +
         " px (proved); without it they come down to " +
         FormatNumber(suspect.max_error_without, 4) + " px.\n";
}

Json SolveOfRestJson(const std::optional<SolveSummary>& solve) {
  if (!solve) return {};
  return {{"num_observations", solve->num_observations},
          {"cost_initial", solve->cost_initial},
          {"cost_final", solve->cost_final},
          {"certified", solve->is_certified},
          {"lower_bound", NumberOrNull(solve->lower_bound)},
          {"relative_gap", NumberOrNull(solve->relative_gap)},
          {"not_held", NotHeldJson(solve->loose)}};
}

Json SnoopingJson(const std::optional<SnoopingSummary>& snooping) {
  if (!snooping) return {};
  return {{"sigma_before_px", NumberOrNull(snooping->sigma_before_px)},
          {"sigma_px", NumberOrNull(snooping->sigma_px)},
          {"critical_w", snooping->critical_w},
          {"num_tested", snooping->num_tested},
          {"num_rounds", snooping->num_rounds},
          {"max_error_px", snooping->max_error_px},
          {"kept_error_before", ErrorJson(snooping->kept_error_before)}};
}

// What noise there is and, as little is worse than not to know, whether what is
// kept fits worse than before.
std::string SnoopingSentences(const OutlierFilterSummary& summary) {
  if (!summary.snooping) return "";
  const SnoopingSummary& snooping = *summary.snooping;
  const auto pixels = [](double value) {
    return FormatNumber(value, 3) + " px";
  };
  const std::string noise = "noise of " + pixels(*snooping.sigma_px) +
                            " per axis (w above " +
                            FormatNumber(snooping.critical_w, 2) + ")";
  if (summary.removed.empty()) {
    return "\nNo observation is more than " + noise +
           " explains: the model is written as it was read.\nTo remove "
           "observations for a bound of your own, give "
           "--OutlierFilter.max_error.\n";
  }
  std::string text =
      "\nWhat was removed is more than " + noise +
      " explains;\nbefore the removal it was " +
      pixels(*snooping.sigma_before_px) +
      ". What is left is at its least squares, rotations fixed.\n";
  if (summary.num_proved > 0) {
    text += "That at least " + Counted(summary.num_proved, "observation") +
            " must go is proved: with these rotations, wherever cameras and\n"
            "points are put, so many have errors that such noise does not "
            "explain (above " +
            pixels(snooping.max_error_px) + ", or less in short tracks).\n";
  }
  const PixelErrorStatistics& before = snooping.kept_error_before;
  const PixelErrorStatistics& after = summary.pixel_error_after;
  const auto rises = [&](const char* name, double was, double is) {
    if (!(is > was)) return;
    text += std::string("Of what is kept, the ") + name +
            " of the errors rises from " + FormatNumber(was, 4) + " to " +
            FormatNumber(is, 4) +
            " px: it was not the least squares that the input minimised.\n";
  };
  rises("mean", before.mean, after.mean);
  rises("RMS", before.rms, after.rms);
  return text;
}

Json ProfileLevelsJson(const ErrorProfileSummary& profile) {
  Json levels = Json::array();
  for (const ErrorProfileSummary::Level& level : profile.levels) {
    levels.push_back({{"num_removed", level.num_removed},
                      {"max_error", level.max_error},
                      {"lower_bound", NumberOrNull(level.lower_bound)},
                      {"num_must_go", level.num_proved},
                      {"point3D_ids", level.point_ids}});
  }
  return {{"levels", std::move(levels)},
          {"elbow", profile.elbow ? Json(*profile.elbow) : Json()}};
}

Json NoiseJson(const std::optional<NoiseSummary>& noise) {
  if (!noise) return {};
  return {{"sigma", noise->limit.sigma},
          {"max_error", noise->limit.max_error},
          {"lowest_max_error", noise->lowest_max_error},
          {"lower_bound", NumberOrNull(noise->lower_bound)}};
}

// What noise explains, and what follows from that.
std::string NoiseSentence(const OutlierFilterSummary& summary) {
  if (!summary.noise) return "";
  const NoiseSummary& noise = *summary.noise;
  const auto pixels = [](double value) {
    return FormatNumber(value, 4) + " px";
  };
  std::string text = "\nGaussian noise of " + pixels(noise.limit.sigma) +
                     " (standard deviation per axis, from the median error) "
                     "explains errors up to " +
                     pixels(noise.limit.max_error) + ".\n";
  if (!noise.ExplainsAll()) {
    text +=
        "Without a removal no translations and points bring all errors "
        "below " +
        pixels(noise.lower_bound) + " (proved): such noise is not all.\n";
  } else if (noise.lowest_max_error <= noise.limit.max_error) {
    text += "Translations and points bring all errors down to " +
            pixels(noise.lowest_max_error) + ": there is no elbow.\n";
  } else {
    text +=
        "It was not proved that some errors stay above that: there is no "
        "elbow.\n";
  }
  if (noise.limit.sigma > kLevelOfStart) {
    text +=
        "Feature points rarely have that much: rotations, intrinsics or "
        "matches may be wrong altogether; look at these first.\n";
  }
  if (summary.max_error > 0) return text;
  return text +
         "No observation is called wrong, and the model is written as it was "
         "read. To remove observations for a bound of your own, give "
         "--OutlierFilter.max_error.\n";
}

std::string ProfileTable(const ErrorProfileSummary& profile) {
  TextTable table;
  table.AddRow({"removed", "must go", "largest error", "proved"});
  for (size_t n = 0; n < profile.levels.size(); ++n) {
    const ErrorProfileSummary::Level& level = profile.levels[n];
    table.AddRow({Thousands(level.num_removed), Thousands(level.num_proved),
                  FormatNumber(level.max_error, 4),
                  level.lower_bound ? FormatNumber(*level.lower_bound, 4) : "",
                  profile.elbow == n ? "<- elbow" : ""});
  }
  return "\nLargest error without some observations, pixels\n" +
         table.ToString();
}

std::string SuspectTable(const OutlierFilterSummary& summary) {
  if (summary.images.empty()) return "";
  TextTable table;
  table.AddRow({"image", "observations", "removed", "conflicts"});
  const size_t count = std::min(summary.images.size(), kShownSuspects);
  for (size_t n = 0; n < count; ++n) {
    const Suspect& image = summary.images[n];
    table.AddRow({image.name, std::to_string(image.num_observations),
                  std::to_string(image.num_removed),
                  std::to_string(image.num_conflicts)});
  }
  return "\nImages with most of them\n" + table.ToString();
}

}  // namespace

std::string OutlierMethodName(OutlierMethod method) {
  switch (method) {
    case OutlierMethod::kConflicts:
      return "conflicts";
    case OutlierMethod::kThreshold:
      return "threshold";
    case OutlierMethod::kSnooping:
      break;
  }
  return "snooping";
}

std::string BracketSentence(const OutlierFilterSummary& summary) {
  std::string sentence =
      "removed " + Thousands(static_cast<int64_t>(summary.removed.size())) +
      " of " + Thousands(summary.num_observations);
  if (summary.conflicts) {
    sentence +=
        "; at least " + Thousands(summary.num_proved) + " must go (" +
        Thousands(summary.num_proved) + " disjoint conflict" +
        (summary.num_proved == 1 ? "" : "s") + ", certificate" +
        (summary.is_search_complete ? ")"
                                    : "; the search for more ended early)");
  }
  return sentence;
}

std::string OutlierTable(const OutlierReport& report) {
  const OutlierFilterSummary& summary = report.summary;
  std::string text = BracketSentence(summary) + "\n";
  if (!summary.is_search_complete) {
    text +=
        "The search for conflicts ended early, as it took too much work: more "
        "may have to go than is proved. Where that happens, rotations, "
        "intrinsics or matches are often wrong altogether, or the bound is far "
        "too low; look at these first.\n";
  }
  if (summary.num_points_removed > 0) {
    text += Counted(summary.num_points_removed, "track") +
            " kept fewer than two and went, with " +
            Counted(summary.num_left_alone, "observation") +
            " that had been left alone.\n";
  }
  TextTable errors;
  errors.AddRow({"", "before", "after"});
  AddErrorColumns({summary.pixel_error_before, summary.pixel_error_after},
                  &errors);
  text += "\nReprojection errors, pixels\n" + errors.ToString();
  text += NoiseSentence(summary) + SnoopingSentences(summary);
  if (summary.profile) text += ProfileTable(*summary.profile);
  text += SuspectTable(summary) + RotationSentence(summary) + "\n";
  if (summary.solve) {
    text += LooseSentences(summary.solve->loose, summary.solve->num_images);
  }
  return text +
         RunSentence(
             report.run,
             "chose " + FormatNumber(summary.seconds_removal, 2) +
                 " s, proved " + FormatNumber(summary.seconds_conflicts, 2) +
                 " s, solved " + FormatNumber(summary.seconds_solve, 2) + " s");
}

std::string OutlierJson(const OutlierReport& report) {
  const OutlierFilterSummary& summary = report.summary;
  const Json json = {
      {"version", report.run.version},
      {"command", "outlier_filter"},
      {"method", OutlierMethodName(summary.method)},
      {"norm", NormName(summary.norm)},
      {"max_error", summary.max_error > 0 ? Json(summary.max_error) : Json()},
      {"noise", NoiseJson(summary.noise)},
      {"is_within", summary.is_within},
      {"num_observations", summary.num_observations},
      {"num_points", summary.num_points},
      {"num_removed", summary.removed.size()},
      {"num_left_alone", summary.num_left_alone},
      {"num_points_removed", summary.num_points_removed},
      {"num_must_go", summary.conflicts ? Json(summary.num_proved) : Json()},
      {"num_irreducible",
       summary.conflicts ? Json(summary.num_irreducible) : Json()},
      {"is_search_complete", summary.is_search_complete},
      {"rotations", RotationsJson(report.run.rotations)},
      {"pixel_error",
       {{"before", ErrorJson(summary.pixel_error_before)},
        {"after", ErrorJson(summary.pixel_error_after)}}},
      {"profile",
       summary.profile ? ProfileLevelsJson(*summary.profile) : Json()},
      {"snooping", SnoopingJson(summary.snooping)},
      {"solve", SolveOfRestJson(summary.solve)},
      {"num_solves", summary.num_solves},
      {"weak_parts", WeakPartsJson(summary)},
      {"removed", RemovedJson(summary.removed)},
      {"suspects",
       {{"tracks", SuspectsJson(summary.tracks, "point3D_id", summary)},
        {"images", SuspectsJson(summary.images, "image_id", summary)},
        {"cameras", SuspectsJson(summary.cameras, "camera_id", summary)}}},
      {"rotation_suspect", RotationSuspectJson(summary)},
  };
  return ReportText(
      json, report.run,
      {{"profile", summary.profile ? Json(summary.profile->seconds) : Json()},
       {"removal", summary.seconds_removal},
       {"conflicts", summary.seconds_conflicts},
       {"solve", summary.seconds_solve}});
}

std::string ProfileJson(const OutlierReport& report) {
  const OutlierFilterSummary& summary = report.summary;
  Json json = {{"version", report.run.version},
               {"command", "outlier_filter"},
               {"norm", NormName(summary.norm)},
               {"num_observations", summary.num_observations}};
  json.update(ProfileLevelsJson(*summary.profile));
  json["noise"] = NoiseJson(summary.noise);
  json["seconds"] = summary.profile->seconds;
  return ReportText(json);
}

std::string OutlierCsv(const OutlierFilterSummary& summary) {
  std::ostringstream csv;
  csv.precision(9);
  csv << "image_id,image_name,point2D_idx,point3D_id,error_before_px,"
         "error_after_px,conflict,w\n";
  for (const RemovedObservation& o : summary.removed) {
    csv << o.image_id << ',' << CsvText(o.image_name) << ',' << o.point2D_idx
        << ',' << o.point3D_id << ',';
    if (std::isfinite(o.error_before_px)) csv << o.error_before_px;
    csv << ',';
    if (std::isfinite(o.error_after_px)) csv << o.error_after_px;
    csv << ',';
    if (o.conflict) csv << *o.conflict;
    csv << ',';
    if (o.w) csv << *o.w;
    csv << '\n';
  }
  return csv.str();
}

}  // namespace krot::internal
