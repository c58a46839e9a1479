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

NoiseFigures FindNoise(const Model& model) {
  NoiseFigures figures;
  static_cast<ModelNoise&>(figures) = EstimateNoise(model);
  figures.num_above_by_image.assign(model.images.size(), 0);
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  for (size_t e = 0; e < image_of.size(); ++e) {
    figures.num_above_by_image[image_of[e]] +=
        figures.observations[e].w > figures.critical_w;
  }
  std::vector<double> w;
  for (const ObservationNoise& one : figures.observations) {
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
  report.noise = FindNoise(model);
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
  TextTable table(ErrorHead(""));
  table.AddRow(ErrorRow("all", report.pixel_error));
  std::string text = "\nTrue reprojection errors, pixels\n" + table.ToString();
  if (report.pixel_error.not_finite > 0) {
    text += std::to_string(report.pixel_error.not_finite) +
            " more observations have no finite error.\n";
  }
  return text;
}

// The `max_rows` with the largest errors: "By image, pixels; the 10 of 96 with
// the largest errors".
template <typename Errors, typename NameOf>
std::string WorstErrorTable(const std::string& name, std::vector<Errors> all,
                            size_t max_rows, const NameOf& name_of) {
  SortLargestFirst(&all, [](const Errors& one) { return one.errors.max; });
  return "\nBy " + name + ", pixels" +
         TextIf(all.size() > max_rows, "; the " + std::to_string(max_rows) +
                                           " of " + std::to_string(all.size()) +
                                           " with the largest errors") +
         "\n" +
         TableOf(
             ErrorHead(name), all,
             [&](const Errors& one) {
               return ErrorRow(name_of(one), one.errors);
             },
             max_rows);
}

std::string CameraErrorTable(const ModelReport& report, size_t max_rows) {
  return WorstErrorTable("camera", report.cameras, max_rows,
                         [](const CameraErrors& camera) {
                           return std::to_string(camera.camera_id) + ", " +
                                  Counted(camera.num_images, "image");
                         });
}

std::string ImageErrorTable(const ModelReport& report, size_t max_rows) {
  return WorstErrorTable(
      "image", report.images, max_rows, [](const ImageErrors& image) {
        return std::to_string(image.image_id) + " " + image.image_name;
      });
}

std::string WorstTable(const std::vector<WorstObservation>& worst) {
  return "\nWorst observations, pixels\n" +
         TableOf({"image", "point2D_idx", "point3D_id", "error"}, worst,
                 [](const WorstObservation& one) -> Row {
                   return {std::to_string(one.image_id) + " " + one.image_name,
                           one.point2D_idx, one.point3D_id,
                           FormatNumber(one.error_px, 4)};
                 });
}

std::string NoiseTable(const NoiseFigures& noise) {
  std::string text =
      "\nNoise, with every point at the least squares of its track\n";
  if (!noise.sigma_px) {
    return text +
           "  cannot be told: no observation is checked by another one.\n";
  }
  Row head = {"w, of so many observations at most"};
  Row own = {"this model"};
  Row gaussian = {"Gaussian noise"};
  for (const NoiseFigures::Quantile& one : noise.quantiles) {
    std::ostringstream share;
    share << 100 * one.share << " %";
    head.push_back(share.str());
    own.push_back(FormatNumber(one.w, 2));
    gaussian.push_back(FormatNumber(one.gaussian_w, 2));
  }
  TextTable table(head);
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
  TextTable table({"track length", "points"});
  int64_t num_longer = 0;
  for (const auto& [length, num_points] : report.track_lengths) {
    if (length > kLongest) {
      num_longer += num_points;
    } else {
      table.AddRow({length, num_points});
    }
  }
  if (num_longer > 0) {
    const int64_t longest = report.track_lengths.rbegin()->first;
    table.AddRow(
        {std::to_string(kLongest + 1) + " to " + std::to_string(longest),
         num_longer});
  }
  return "\nTracks\n" + table.ToString() +
         std::to_string(report.num_tracks_with_repeated_image) +
         " tracks hold two or more observations of one image.\n";
}

std::string GeometryTable(const ModelReport& report) {
  TextTable table({"", "min", "median", "max"});
  const auto add = [&](const char* name, const ValueRange& range) {
    table.AddRow({name, FormatNumber(range.min, 4),
                  FormatNumber(range.median, 4), FormatNumber(range.max, 4)});
  };
  add("depth, scene units", report.depth);
  add("triangulation angle, degrees", report.triangulation_angle_deg);
  return "\nGeometry\n" + table.ToString() +
         std::to_string(report.depth.not_positive) +
         " observations lie in or behind the plane of their camera.\n";
}

}  // namespace

std::string ModelTable(const ModelReport& report, int max_rows) {
  const auto num_rows = static_cast<size_t>(max_rows);
  return ColmapFigures(report.colmap) + OverallErrors(report) +
         CameraErrorTable(report, num_rows) +
         ImageErrorTable(report, num_rows) + WorstTable(report.worst) +
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

Json CameraErrorsJson(const CameraErrors& camera) {
  return {{"camera_id", camera.camera_id},
          {"num_images", camera.num_images},
          {"pixel_error", CountedErrorJson(camera.errors)}};
}

Json WorstJson(const WorstObservation& worst) {
  return ObservationJson(worst, {{"error_px", worst.error_px}});
}

Json NoiseJson(const NoiseFigures& noise) {
  Json json = KROT_JSON_OF(noise, sigma_px, cauchy_scale_px);
  json.update(
      KnownIf(noise.sigma_px.has_value(), KROT_JSON_OF(noise, critical_w)));
  json.update(KROT_JSON_OF(noise, num_tested, num_above, num_half_controlled,
                           num_uncontrolled));
  json["w"] = ListJson(noise.quantiles, [](const auto& one) {
    return KROT_JSON_OF(one, share, w, gaussian_w);
  });
  return json;
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
  Json json = {{"version", version}, {"command", "model_analyzer"}};
  json["colmap"] = KROT_JSON_OF(
      report.colmap, num_rigs, num_cameras, num_frames, num_images,
      num_registered_images, num_points, num_observations, mean_track_length,
      mean_observations_per_image, mean_reprojection_error);
  json["contradictions"] = ContradictionsJson(report.contradictions);
  json["poses"] = PosesJson(report.poses);
  json["pixel_error"] = CountedErrorJson(report.pixel_error);
  json["cameras"] = ListJson(report.cameras, CameraErrorsJson);
  json["images"] = ImageErrorsJson(report);
  json["worst"] = ListJson(report.worst, WorstJson);
  json["noise"] = NoiseJson(report.noise);
  json["track_lengths"] = TrackLengthsJson(report.track_lengths);
  json.update(KROT_JSON_OF(report, num_tracks_with_repeated_image));
  json.update(KROT_JSON_OF(report.faults, num_in_camera, num_parts));
  json["distances"] = DistancesJson(report.distances, {"model"});
  json["depth"] =
      KROT_JSON_OF(report.depth, count, not_positive, min, median, max);
  json["triangulation_angle_deg"] =
      KROT_JSON_OF(report.triangulation_angle_deg, count, min, median, max);
  return ReportText(json);
}

}  // namespace krot::internal
