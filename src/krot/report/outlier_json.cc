#include "krot/report/reports.h"

#include <cmath>
#include <sstream>
#include <string>
#include <vector>

#include "krot/report/report_json.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

Json RemovedJson(const std::vector<RemovedObservation>& removed) {
  return ListJson(removed, [&](const RemovedObservation& o) -> Json {
    return ObservationJson(
        o, {{"error_before_px", FiniteOrNull(o.error_before_px)},
            {"error_after_px", FiniteOrNull(o.error_after_px)},
            {"conflict", NumberOrNull(o.conflict)},
            {"w", o.w ? FiniteOrNull(*o.w) : Json()}});
  });
}

// The share of conflicts that would vanish without this suspect.
Json ConflictShare(int64_t num_conflicts, const OutlierFilterSummary& summary) {
  if (summary.num_proved == 0) return {};
  return static_cast<double>(num_conflicts) /
         static_cast<double>(summary.num_proved);
}

Json SuspectsJson(const std::vector<Suspect>& suspects, const char* id,
                  const OutlierFilterSummary& summary) {
  return ListJson(suspects, [&](const Suspect& suspect) -> Json {
    Json one = {{id, suspect.id}};
    if (!suspect.name.empty()) one["image_name"] = suspect.name;
    one["num_observations"] = suspect.num_observations;
    one["num_removed"] = suspect.num_removed;
    one["num_conflicts"] = suspect.num_conflicts;
    one["conflict_share"] = ConflictShare(suspect.num_conflicts, summary);
    return one;
  });
}

Json RotationSuspectJson(const OutlierFilterSummary& summary) {
  if (!summary.rotation_suspect) return {};
  const RotationSuspect& suspect = *summary.rotation_suspect;
  return {{"image_id", suspect.image_id},
          {"image_name", suspect.image_name},
          {"num_conflicts", suspect.num_conflicts},
          {"conflict_share", ConflictShare(suspect.num_conflicts, summary)},
          {"angle_deg", suspect.angle_deg},
          {"axis_in_cam", VectorJson(suspect.axis_in_cam)},
          {"num_observations", suspect.num_observations},
          {"num_above", suspect.num_above},
          {"num_above_turned", suspect.num_above_turned},
          {"lower_bound_with", suspect.lower_bound_with},
          {"max_error_without", suspect.max_error_without}};
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

Json ProfileLevelsJson(const ErrorProfileSummary& profile) {
  Json levels = ListJson(profile.levels, [&](const auto& level) -> Json {
    return {{"num_removed", level.num_removed},
            {"max_error", level.max_error},
            {"lower_bound", NumberOrNull(level.lower_bound)},
            {"num_must_go", level.num_proved},
            {"point3D_ids", level.point_ids}};
  });
  return {{"levels", std::move(levels)},
          {"elbow", NumberOrNull(profile.elbow)}};
}

Json NoiseJson(const std::optional<NoiseSummary>& noise) {
  if (!noise) return {};
  return {{"sigma", noise->limit.sigma},
          {"max_error", noise->limit.max_error},
          {"lowest_max_error", noise->lowest_max_error},
          {"lower_bound", noise->lower_bound}};
}

}  // namespace

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

Json WeakPartsJson(const OutlierFilterSummary& summary) {
  return ListJson(summary.weak_parts, [&](const WeakPart& part) -> Json {
    return {{"is_frame", part.is_frame},
            {"image_names", part.image_names},
            {"num_tracks", part.num_tracks},
            {"num_agreeing", part.num_agreeing},
            {"scale_factor", FiniteOrNull(part.scale_factor)},
            {"is_held", part.is_held},
            {"turn_deg", part.turn_deg},
            {"num_agreeing_turned", part.num_agreeing_turned}};
  });
}

}  // namespace krot::internal
