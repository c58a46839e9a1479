#include "krot/report/report_json.h"

namespace krot {

Json NumberOrNull(const std::optional<double>& value) {
  return value ? Json(*value) : Json();
}

Json VectorJson(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
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
  return {{"track_elements", contradictions.num_track_elements},
          {"points2D", contradictions.num_points2D}};
}

Json RotationsJson(const std::optional<ReplacedRotations>& rotations) {
  if (!rotations) return Json();
  return {{"num_frames", rotations->num_frames},
          {"num_kept_images", rotations->num_kept_images}};
}

std::string ReportText(const Json& json) {
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace krot
