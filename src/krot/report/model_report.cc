#include "krot/report/reports.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "krot/base/numbers.h"
#include "krot/model/rigs.h"
#include "krot/report/report_json.h"
#include "krot/report/text_table.h"

namespace krot::internal {
namespace {

bool RepeatsAnImage(const Model& model, const Point3D& point) {
  std::set<ImageId> images;
  for (const TrackElement& element : TrackOf(model, point)) {
    if (!images.insert(element.image_id).second) return true;
  }
  return false;
}

NoiseFigures FiguresOf(const Model& model, const ModelNoise& noise) {
  NoiseFigures figures;
  figures.sigma_px = noise.sigma_px;
  figures.cauchy_scale_px = noise.cauchy_scale_px;
  figures.critical_w = noise.critical_w;
  figures.num_tested = noise.num_tested;
  figures.num_above = noise.num_above;
  figures.num_above_by_image.assign(model.images.size(), 0);
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  for (size_t e = 0; e < image_of.size(); ++e) {
    figures.num_above_by_image[image_of[e]] +=
        noise.observations[e].w > noise.critical_w;
  }
  std::vector<double> w;
  for (const ObservationNoise& one : noise.observations) {
    figures.num_half_controlled += one.num_controlled == 1;
    figures.num_uncontrolled += one.num_controlled == 0;
    if (one.num_controlled > 0) w.push_back(one.w);
  }
  if (w.empty()) return figures;
  std::sort(w.begin(), w.end());
  for (const double share : {0.5, 0.9, 0.99, 0.999}) {
    const double rank = std::ceil(share * static_cast<double>(w.size()));
    figures.quantiles.push_back({share, w[static_cast<size_t>(rank) - 1],
                                 std::sqrt(-2 * std::log1p(-share))});
  }
  return figures;
}

}  // namespace

ModelReport AnalyzeModel(const Model& model, int num_worst) {
  const std::vector<double> errors_px = PixelErrors(model);
  ModelReport report;
  report.colmap = ComputeColmapStatistics(model);
  report.pixel_error = Summarize(errors_px);
  report.images = ErrorsByImage(model, errors_px);
  report.cameras = ErrorsByCamera(model, errors_px);
  report.worst = WorstObservations(model, errors_px, num_worst);
  report.noise = FiguresOf(model, EstimateNoise(model, {}, {}));
  report.track_lengths = TrackLengthHistogram(model);
  report.num_tracks_with_repeated_image = std::count_if(
      model.points3D.begin(), model.points3D.end(),
      [&](const Point3D& point) { return RepeatsAnImage(model, point); });
  report.faults = FindLastingFaults(model);
  report.depth = ComputeDepthStatistics(model);
  report.triangulation_angle_deg = TriangulationAnglesDeg(model);
  return report;
}

namespace {

std::string ColmapFigures(const ColmapStatistics& colmap) {
  std::ostringstream text;
  if (colmap.num_rigs > 0) {
    text << "Rigs: " << colmap.num_rigs << '\n'
         << "Frames: " << colmap.num_frames << '\n';
  }
  text << "Cameras: " << colmap.num_cameras << '\n'
       << "Images: " << colmap.num_images << '\n'
       << "Registered images: " << colmap.num_registered_images << '\n'
       << "Points: " << colmap.num_points << '\n'
       << "Observations: " << colmap.num_observations << '\n'
       << "Mean track length: " << FormatNumber(colmap.mean_track_length, 6)
       << '\n'
       << "Mean observations per image: "
       << FormatNumber(colmap.mean_observations_per_image, 6) << '\n'
       << "Mean reprojection error: "
       << FormatNumber(colmap.mean_reprojection_error, 6) << "px\n";
  return text.str();
}

std::string OverallErrors(const ModelReport& report) {
  TextTable table;
  AddErrorHead("", &table);
  AddErrorRow("all", report.pixel_error, &table);
  std::string text = "\nTrue reprojection errors, pixels\n" + table.ToString();
  if (report.pixel_error.not_finite > 0) {
    text += std::to_string(report.pixel_error.not_finite) +
            " more observations have no finite error.\n";
  }
  return text;
}

// Keeps the `max_rows` with the largest errors, and returns the head of their
// table: "By image, pixels; the 10 of 96 with the largest errors".
template <typename Errors>
std::string KeepWorst(const std::string& name, size_t max_rows,
                      std::vector<Errors>* all) {
  const size_t total = all->size();
  SortLargestFirst(all, [](const Errors& one) { return one.errors.max; });
  all->resize(std::min(total, max_rows));
  return "\nBy " + name + ", pixels" +
         (all->size() < total
              ? "; the " + std::to_string(all->size()) + " of " +
                    std::to_string(total) + " with the largest errors"
              : std::string()) +
         "\n";
}

std::string CameraErrorTable(std::vector<CameraErrors> cameras,
                             size_t max_cameras) {
  const std::string head = KeepWorst("camera", max_cameras, &cameras);
  TextTable table;
  AddErrorHead("camera", &table);
  for (const CameraErrors& camera : cameras) {
    AddErrorRow(std::to_string(camera.camera_id) + ", " +
                    Counted(camera.num_images, "image"),
                camera.errors, &table);
  }
  return head + table.ToString();
}

std::string ImageErrorTable(std::vector<ImageErrors> images,
                            size_t max_images) {
  const std::string head = KeepWorst("image", max_images, &images);
  TextTable table;
  AddErrorHead("image", &table);
  for (const ImageErrors& image : images) {
    AddErrorRow(std::to_string(image.image_id) + " " + image.image_name,
                image.errors, &table);
  }
  return head + table.ToString();
}

std::string WorstTable(const std::vector<WorstObservation>& worst) {
  TextTable table;
  table.AddRow({"image", "point2D_idx", "point3D_id", "error"});
  for (const WorstObservation& observation : worst) {
    table.AddRow(
        {std::to_string(observation.image_id) + " " + observation.image_name,
         std::to_string(observation.point2D_idx),
         std::to_string(observation.point3D_id),
         FormatNumber(observation.error_px, 4)});
  }
  return "\nWorst observations, pixels\n" + table.ToString();
}

std::string NoiseTable(const NoiseFigures& noise) {
  std::string text =
      "\nNoise, with every point at the least squares of its track\n";
  if (!noise.sigma_px) {
    return text +
           "  cannot be told: no observation is checked by another one.\n";
  }
  TextTable table;
  std::vector<std::string> head = {"w, of so many observations at most"};
  std::vector<std::string> own = {"this model"};
  std::vector<std::string> gaussian = {"Gaussian noise"};
  for (const NoiseFigures::Quantile& one : noise.quantiles) {
    std::ostringstream share;
    share << 100 * one.share << " %";
    head.push_back(share.str());
    own.push_back(FormatNumber(one.w, 2));
    gaussian.push_back(FormatNumber(one.gaussian_w, 2));
  }
  table.AddRow(head);
  table.AddRow(own);
  table.AddRow(gaussian);
  text += "  " + FormatNumber(*noise.sigma_px, 3) +
          " pixels per axis (robust standard deviation); w is an error over "
          "what such noise makes of it.\n" +
          table.ToString() + std::to_string(noise.num_above) + " of " +
          std::to_string(noise.num_tested) +
          " observations are more than that noise explains (w above " +
          FormatNumber(noise.critical_w, 2) + ")";
  text += noise.num_above > 0 ? "; krot outlier_filter removes such.\n" : ".\n";
  if (noise.cauchy_scale_px) {
    text +=
        "Its tails are heavier than Gaussian: a Cauchy loss with a scale of " +
        FormatNumber(*noise.cauchy_scale_px, 3) + " pixels suits them.\n";
  }
  return text + "An error in one direction would not show in " +
         std::to_string(noise.num_half_controlled) +
         " observations, in any direction in " +
         std::to_string(noise.num_uncontrolled) + ".\n";
}

// Track lengths up to kLongest have a row each; the longer ones share one.
std::string TrackTable(const ModelReport& report) {
  constexpr int64_t kLongest = 10;
  TextTable table;
  table.AddRow({"track length", "points"});
  int64_t num_longer = 0;
  for (const auto& [length, num_points] : report.track_lengths) {
    if (length > kLongest) {
      num_longer += num_points;
    } else {
      table.AddRow({std::to_string(length), std::to_string(num_points)});
    }
  }
  if (num_longer > 0) {
    const int64_t longest = report.track_lengths.rbegin()->first;
    table.AddRow(
        {std::to_string(kLongest + 1) + " to " + std::to_string(longest),
         std::to_string(num_longer)});
  }
  return "\nTracks\n" + table.ToString() +
         std::to_string(report.num_tracks_with_repeated_image) +
         " tracks hold two or more observations of one image.\n";
}

std::string GeometryTable(const ModelReport& report) {
  const DepthStatistics& depth = report.depth;
  const ValueRange& angle = report.triangulation_angle_deg;
  TextTable table;
  table.AddRow({"", "min", "median", "max"});
  table.AddRow({"depth, scene units", FormatNumber(depth.min, 4),
                FormatNumber(depth.median, 4), FormatNumber(depth.max, 4)});
  table.AddRow({"triangulation angle, degrees", FormatNumber(angle.min, 4),
                FormatNumber(angle.median, 4), FormatNumber(angle.max, 4)});
  return "\nGeometry\n" + table.ToString() +
         std::to_string(depth.not_positive) +
         " observations lie in or behind the plane of their camera.\n";
}

}  // namespace

std::string ModelTable(const ModelReport& report, int max_rows) {
  const auto num_rows = static_cast<size_t>(max_rows);
  return ColmapFigures(report.colmap) + OverallErrors(report) +
         CameraErrorTable(report.cameras, num_rows) +
         ImageErrorTable(report.images, num_rows) + WorstTable(report.worst) +
         NoiseTable(report.noise) + TrackTable(report) + GeometryTable(report) +
         LastingFaultLines(report.faults) +
         (report.distances ? DistanceTable(*report.distances, {"model"}) : "");
}

std::string ModelCsv(const ModelReport& report) {
  std::ostringstream csv;
  csv.precision(9);
  csv << "image_id,image_name,camera_id,num_images,num_observations,"
         "num_not_finite,max_px,p99_px,mean_px,rms_px\n";
  const auto add = [&](const PixelErrorStatistics& errors) {
    csv << errors.count << ',' << errors.not_finite;
    for (const double value :
         {errors.max, errors.p99, errors.mean, errors.rms}) {
      csv << ',';
      if (errors.count > 0) csv << value;
    }
    csv << '\n';
  };
  for (const CameraErrors& camera : report.cameras) {
    csv << ",," << camera.camera_id << ',' << camera.num_images << ',';
    add(camera.errors);
  }
  for (const ImageErrors& image : report.images) {
    csv << image.image_id << ',' << CsvText(image.image_name) << ','
        << image.camera_id << ",1,";
    add(image.errors);
  }
  return csv.str();
}

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
  return ListJson(cameras, [&](const CameraErrors& camera) -> Json {
    return {{"camera_id", camera.camera_id},
            {"num_images", camera.num_images},
            {"pixel_error", CountedErrorJson(camera.errors)}};
  });
}

Json WorstJson(const std::vector<WorstObservation>& worst) {
  return ListJson(worst, [&](const WorstObservation& observation) -> Json {
    return ObservationJson(observation, {{"error_px", observation.error_px}});
  });
}

Json NoiseJson(const NoiseFigures& noise) {
  Json quantiles = ListJson(noise.quantiles, [&](const auto& one) -> Json {
    return {{"share", one.share}, {"w", one.w}, {"gaussian_w", one.gaussian_w}};
  });
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
  const ValueRange& angle = report.triangulation_angle_deg;
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
      {"num_in_camera", report.faults.num_in_camera},
      {"num_parts", report.faults.num_parts},
      {"distances", DistancesJson(report.distances, {"model"})},
      {"depth",
       {{"count", depth.count},
        {"not_positive", depth.not_positive},
        {"min", depth.min},
        {"median", depth.median},
        {"max", depth.max}}},
      {"triangulation_angle_deg",
       {{"count", angle.count},
        {"min", angle.min},
        {"median", angle.median},
        {"max", angle.max}}},
  };
  return ReportText(json);
}

}  // namespace krot::internal
