#include "krot/report/report_json.h"

#include <cmath>

namespace krot::internal {

Json FiniteOrNull(double value) {
  return std::isfinite(value) ? Json(value) : Json();
}

Json ErrorJson(const PixelErrorStatistics& errors) {
  const auto known = [&errors](double value) {
    return errors.count > 0 ? Json(value) : Json();
  };
  return {{"max", known(errors.max)},
          {"p99", known(errors.p99)},
          {"mean", known(errors.mean)},
          {"rms", known(errors.rms)}};
}

Json CountedErrorJson(const PixelErrorStatistics& errors) {
  Json json = {{"count", errors.count}, {"not_finite", errors.not_finite}};
  json.update(ErrorJson(errors));
  return json;
}

Json LeftOutJson(const LeftOutCounts& left_out) {
  Json json = Json::object();
  for (const auto& [reason, count] : left_out) json[reason] = count;
  return json;
}

Json ContradictionsJson(const Contradictions& contradictions) {
  using Fit = Contradictions::Fit;
  const auto fit = [](const std::optional<Fit>& side, double Fit::*px) {
    return side && std::isfinite((*side).*px) ? Json((*side).*px) : Json();
  };
  return {{"track_elements", contradictions.num_track_elements},
          {"points2D", contradictions.num_points2D},
          {"followed", contradictions.followed.empty()
                           ? Json()
                           : Json(contradictions.followed)},
          {"median_px",
           {{"tracks", fit(contradictions.of_tracks, &Fit::median)},
            {"images", fit(contradictions.of_images, &Fit::median)}}},
          {"max_px",
           {{"tracks", fit(contradictions.of_tracks, &Fit::max)},
            {"images", fit(contradictions.of_images, &Fit::max)}}}};
}

Json PosesJson(const PoseChecks& poses) {
  return {
      {"num_far_quaternions", poses.num_far_quaternions},
      {"is_exchanged", poses.is_exchanged},
      {"num_stale_images", poses.num_stale},
      {"stale_turn_deg",
       {{"median", poses.median_turn_deg}, {"max", poses.largest_turn_deg}}}};
}

Json VerdictJson(const std::optional<CertificateVerdict>& verdict) {
  if (!verdict) return Json();
  return {{"lower_bound", verdict->lower_bound},
          {"cost", NumberOrNull(verdict->cost)},
          {"relative_gap", NumberOrNull(verdict->relative_gap)},
          {"num_support", verdict->support.size()},
          {"num_fixed_frames", verdict->num_fixed_images},
          {"num_fixed_points", verdict->num_fixed_points},
          {"num_positions", verdict->positions.size()}};
}

Json RotationsJson(const std::optional<RotationInput>& rotations) {
  if (!rotations) return Json();
  const ReplacedRotations& replaced = rotations->replaced;
  return {
      {"num_frames", replaced.num_frames},
      {"num_kept_images", replaced.num_kept_images},
      {"turn_deg",
       {{"median", replaced.median_turn_deg},
        {"max", replaced.largest_turn_deg}}},
      {"frame_turn_deg", replaced.frame_turn_deg},
      {"median_error_px",
       {{"before", NumberOrNull(rotations->median_error_before)},
        {"after", NumberOrNull(rotations->median_error_after)}}},
      {"mistake", replaced.mistake.empty() ? Json() : Json(replaced.mistake)}};
}

Json NotHeldJson(const LooseParts& loose) {
  Json images = ListJson(loose.images, [&](const LooseImage& image) -> Json {
    return {{"image_id", image.image_id},
            {"image_name", image.image_name},
            {"num_observations", image.num_observations},
            {"is_determined", image.is_determined},
            {"moved", image.moved}};
  });
  Json points = ListJson(loose.points, [&](const LoosePoint& point) -> Json {
    return {{"point3D_id", point.point3D_id}, {"moved", point.moved}};
  });
  return {{"images", std::move(images)}, {"points", std::move(points)}};
}

std::string ReportText(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string ReportText(Json json, const RunRecord& run, const Json& seconds) {
  json["contradictions"] = ContradictionsJson(run.contradictions);
  json["poses"] = PosesJson(run.poses);
  Json& all = json["seconds"] = {{"read", run.seconds_read}};
  all.update(seconds);
  all["write"] = run.seconds_write;
  all["total"] = run.seconds_total;
  json["peak_memory_bytes"] = run.peak_memory_bytes;
  json["threads"] = run.threads;
  json["seed"] = run.seed;
  return ReportText(json);
}

}  // namespace krot::internal
