#include "krot/report/model_report.h"
#include "krot/report/report_json.h"

namespace krot::internal {
namespace {

Json ColmapJson(const ColmapStatistics& colmap) {
  return {{"num_rigs", colmap.num_rigs},
          {"num_cameras", colmap.num_cameras},
          {"num_frames", colmap.num_frames},
          {"num_images", colmap.num_images},
          {"num_registered_images", colmap.num_registered_images},
          {"num_points", colmap.num_points},
          {"num_observations", colmap.num_observations},
          {"mean_track_length", colmap.mean_track_length},
          {"mean_observations_per_image", colmap.mean_observations_per_image},
          {"mean_reprojection_error", colmap.mean_reprojection_error}};
}

Json ImageErrorsJson(const ModelReport& report) {
  Json json = Json::array();
  for (size_t n = 0; n < report.images.size(); ++n) {
    const ImageErrors& image = report.images[n];
    json.push_back({{"image_id", image.image_id},
                    {"image_name", image.image_name},
                    {"pixel_error", CountedErrorJson(image.errors)},
                    {"num_above", report.noise.num_above_by_image[n]}});
  }
  return json;
}

Json CamerasJson(const std::vector<CameraErrors>& cameras) {
  Json json = Json::array();
  for (const CameraErrors& camera : cameras) {
    json.push_back({{"camera_id", camera.camera_id},
                    {"num_images", camera.num_images},
                    {"pixel_error", CountedErrorJson(camera.errors)}});
  }
  return json;
}

Json WorstJson(const std::vector<WorstObservation>& worst) {
  Json json = Json::array();
  for (const WorstObservation& observation : worst) {
    json.push_back({{"image_id", observation.image_id},
                    {"image_name", observation.image_name},
                    {"point2D_idx", observation.point2D_idx},
                    {"point3D_id", observation.point3D_id},
                    {"error_px", observation.error_px}});
  }
  return json;
}

Json NoiseJson(const NoiseFigures& noise) {
  Json quantiles = Json::array();
  for (const NoiseFigures::Quantile& one : noise.quantiles) {
    quantiles.push_back(
        {{"share", one.share}, {"w", one.w}, {"gaussian_w", one.gaussian_w}});
  }
  const auto if_known = [&](double value) {
    return noise.sigma_px ? Json(value) : Json();
  };
  return {{"sigma_px", NumberOrNull(noise.sigma_px)},
          {"cauchy_scale_px", NumberOrNull(noise.cauchy_scale_px)},
          {"critical_w", if_known(noise.critical_w)},
          {"num_tested", noise.num_tested},
          {"num_above", noise.num_above},
          {"num_half_controlled", noise.num_half_controlled},
          {"num_uncontrolled", noise.num_uncontrolled},
          {"w", quantiles}};
}

Json TrackLengthsJson(const std::map<int64_t, int64_t>& track_lengths) {
  Json json = Json::array();
  for (const auto& [length, num_points] : track_lengths) {
    json.push_back({{"length", length}, {"num_points", num_points}});
  }
  return json;
}

}  // namespace

std::string ModelJson(const ModelReport& report, const std::string& version) {
  const DepthStatistics& depth = report.depth;
  const TriangulationAngleStatistics& angle = report.triangulation_angle;
  const Json json = {
      {"version", version},
      {"command", "model_analyzer"},
      {"colmap", ColmapJson(report.colmap)},
      {"contradictions", ContradictionsJson(report.contradictions)},
      {"poses", PosesJson(report.poses)},
      {"pixel_error", CountedErrorJson(report.pixel_error)},
      {"cameras", CamerasJson(report.cameras)},
      {"images", ImageErrorsJson(report)},
      {"worst", WorstJson(report.worst)},
      {"noise", NoiseJson(report.noise)},
      {"track_lengths", TrackLengthsJson(report.track_lengths)},
      {"num_tracks_with_repeated_image", report.num_tracks_with_repeated_image},
      {"depth",
       {{"count", depth.count},
        {"not_positive", depth.not_positive},
        {"min", depth.min},
        {"median", depth.median},
        {"max", depth.max}}},
      {"triangulation_angle_deg",
       {{"count", angle.count},
        {"min", angle.min_deg},
        {"median", angle.median_deg},
        {"max", angle.max_deg}}},
  };
  return ReportText(json);
}

}  // namespace krot::internal
