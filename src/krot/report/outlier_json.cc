#include "krot/report/reports.h"

#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "krot/report/report_json.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

Json RemovedJson(const RemovedObservation& o) {
  return ObservationJson(
      o, KROT_JSON_OF(o, error_before_px, error_after_px, conflict, w));
}

// The share of conflicts that would vanish without this suspect.
Json ConflictShare(int64_t num_conflicts, const OutlierFilterSummary& summary) {
  if (summary.num_proved == 0) return {};
  return static_cast<double>(num_conflicts) /
         static_cast<double>(summary.num_proved);
}

Json SuspectsJson(const std::vector<Suspect>& suspects, const char* id,
                  const OutlierFilterSummary& summary) {
  return ListJson(suspects, [&](const Suspect& suspect) {
    Json one = {{id, suspect.id}};
    if (!suspect.name.empty()) one["image_name"] = suspect.name;
    one.update(
        KROT_JSON_OF(suspect, num_observations, num_removed, num_conflicts));
    one["conflict_share"] = ConflictShare(suspect.num_conflicts, summary);
    return one;
  });
}

Json SolveOfRestJson(const SolveSummary& solve) {
  Json json = KROT_JSON_OF(solve, num_observations, cost_initial, cost_final);
  json["certified"] = solve.is_certified;
  json.update(KROT_JSON_OF(solve, lower_bound, relative_gap));
  json["not_held"] = NotHeldJson(solve.loose);
  return json;
}

Json SnoopingJson(const SnoopingSummary& snooping) {
  return Joined(KROT_JSON_OF(snooping, sigma_before_px, sigma_px, critical_w,
                             num_tested, num_rounds, max_error_px, is_solved),
                {{"kept_error_before", ErrorJson(snooping.kept_error_before)}});
}

Json ProfileLevelsJson(const ErrorProfileSummary& profile) {
  return {{"levels", ListJson(profile.levels,
                              [](const ErrorProfileSummary::Level& level) {
                                Json json = KROT_JSON_OF(
                                    level, num_removed, max_error, lower_bound);
                                json["num_must_go"] = level.num_proved;
                                json["point3D_ids"] = level.point_ids;
                                return json;
                              })},
          {"elbow", profile.elbow}};
}

Json NoiseLimitJson(const NoiseSummary& noise) {
  return Joined(KROT_JSON_OF(noise.limit, sigma, max_error),
                KROT_JSON_OF(noise, lowest_max_error, lower_bound));
}

}  // namespace

std::string OutlierJson(const OutlierReport& report) {
  const OutlierFilterSummary& summary = report.summary;
  const auto of_rotation = [&](const RotationSuspect& suspect) {
    Json one = KROT_JSON_OF(suspect, image_id, image_name, num_conflicts);
    one["conflict_share"] = ConflictShare(suspect.num_conflicts, summary);
    one["angle_deg"] = suspect.angle_deg;
    one["axis_in_cam"] = VectorJson(suspect.axis_in_cam);
    one.update(KROT_JSON_OF(suspect, num_observations, num_above,
                            num_above_turned, lower_bound_with,
                            max_error_without));
    return one;
  };
  Json json = {
      {"version", report.run.version},
      {"command", "outlier_filter"},
      {"method", OutlierMethodName(summary.method)},
      {"norm", NormName(summary.norm)},
      {"max_error", summary.max_error > 0 ? Json(summary.max_error) : Json()},
      {"noise", JsonIf(summary.noise, NoiseLimitJson)}};
  json.update(OutlierCountsJson(summary));
  json["num_irreducible"] =
      summary.conflicts ? Json(summary.num_irreducible) : Json();
  json["is_search_complete"] = summary.is_search_complete;
  json["rotations"] = JsonIf(report.run.rotations, RotationsJson);
  json["pixel_error"] =
      BeforeAfterJson(summary.pixel_error_before, summary.pixel_error_after);
  json["profile"] = JsonIf(summary.profile, ProfileLevelsJson);
  json["snooping"] = JsonIf(summary.snooping, SnoopingJson);
  json["solve"] = JsonIf(summary.solve, SolveOfRestJson);
  json["num_solves"] = summary.num_solves;
  json["weak_parts"] = WeakPartsJson(summary);
  json["one_centre_turn_deg"] = summary.one_centre_turn_deg;
  json["removed"] = ListJson(summary.removed, RemovedJson);
  json["suspects"] = {
      {"tracks", SuspectsJson(summary.tracks, "point3D_id", summary)},
      {"images", SuspectsJson(summary.images, "image_id", summary)},
      {"cameras", SuspectsJson(summary.cameras, "camera_id", summary)}};
  json["rotation_suspect"] = JsonIf(summary.rotation_suspect, of_rotation);
  return ReportText(json, report.run,
                    {{"profile", JsonIf(summary.profile,
                                        [](const ErrorProfileSummary& of) {
                                          return of.seconds;
                                        })},
                     {"removal", summary.seconds_removal},
                     {"conflicts", summary.seconds_conflicts},
                     {"solve", summary.seconds_solve}});
}

Json OutlierCountsJson(const OutlierFilterSummary& summary) {
  Json json = KROT_JSON_OF(summary, is_within, num_observations, num_points);
  json["num_removed"] = summary.removed.size();
  json.update(KROT_JSON_OF(summary, num_left_alone, num_points_removed));
  json["num_must_go"] = summary.conflicts ? Json(summary.num_proved) : Json();
  return json;
}

std::string ProfileJson(const OutlierReport& report) {
  const OutlierFilterSummary& summary = report.summary;
  Json json = {{"version", report.run.version},
               {"command", "outlier_filter"},
               {"norm", NormName(summary.norm)},
               {"num_observations", summary.num_observations}};
  json.update(ProfileLevelsJson(*summary.profile));
  json["noise"] = JsonIf(summary.noise, NoiseLimitJson);
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

Json WeakPartsJson(const OutlierFilterSummary& summary) {
  return ListJson(summary.weak_parts, [](const WeakPart& part) {
    return KROT_JSON_OF(part, is_frame, image_names, num_tracks, num_of_three,
                        num_agreeing, scale_factor, is_held, turn_deg,
                        num_agreeing_turned);
  });
}

}  // namespace krot::internal
