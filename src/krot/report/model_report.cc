#include "krot/report/model_report.h"

#include <algorithm>
#include <sstream>

#include <nlohmann/json.hpp>

#include "krot/report/text_table.h"

namespace krot {
namespace {

using Json = nlohmann::ordered_json;

std::string ColmapFigures(const ModelStatistics& statistics) {
  std::ostringstream text;
  if (statistics.num_rigs > 0) text << "Rigs: " << statistics.num_rigs << '\n';
  text << "Cameras: " << statistics.num_cameras << '\n';
  if (statistics.num_frames > 0) {
    text << "Frames: " << statistics.num_frames << '\n';
  }
  text << "Images: " << statistics.num_images << '\n'
       << "Registered images: " << statistics.num_images << '\n'
       << "Points: " << statistics.num_points << '\n'
       << "Observations: " << statistics.num_observations << '\n'
       << "Mean track length: " << FormatNumber(statistics.mean_track_length, 6)
       << '\n'
       << "Mean observations per image: "
       << FormatNumber(statistics.mean_observations_per_image, 6) << '\n'
       << "Mean reprojection error: "
       << FormatNumber(statistics.mean_stored_error, 6) << "px\n";
  return text.str();
}

void AddErrorRow(const std::string& name, const PixelErrorStatistics& error,
                 TextTable* table) {
  table->AddRow({name, std::to_string(error.count), FormatNumber(error.max, 4),
                 FormatNumber(error.p99, 4), FormatNumber(error.mean, 4),
                 FormatNumber(error.rms, 4)});
}

std::string ErrorTable(const std::vector<ErrorGroup>& groups) {
  TextTable table;
  table.AddRow({"id", "observations", "max", "P99", "mean", "RMS"});
  for (const ErrorGroup& group : groups) {
    AddErrorRow(std::to_string(group.id) + " " + group.name, group.error,
                &table);
  }
  return table.ToString();
}

std::vector<ErrorGroup> WithLargestErrors(std::vector<ErrorGroup> groups,
                                          size_t max_groups) {
  std::stable_sort(groups.begin(), groups.end(),
                   [](const ErrorGroup& a, const ErrorGroup& b) {
                     return a.error.max > b.error.max;
                   });
  if (groups.size() > max_groups) groups.resize(max_groups);
  return groups;
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
  return table.ToString();
}

std::string DistributionTable(const ModelStatistics& statistics) {
  TextTable table;
  table.AddRow({"", "min", "median", "mean", "max"});
  const auto add = [&table](const char* name, const Distribution& d,
                            int decimals) {
    table.AddRow({name, FormatNumber(d.min, decimals),
                  FormatNumber(d.median, decimals), FormatNumber(d.mean, 4),
                  FormatNumber(d.max, decimals)});
  };
  add("track length", statistics.track_length, 0);
  add("depth, scene units", statistics.depth, 4);
  return table.ToString();
}

Json ErrorJson(const PixelErrorStatistics& error) {
  Json json = {{"count", error.count}, {"not_finite", error.not_finite}};
  const bool known = error.count > 0;
  json["max"] = known ? Json(error.max) : Json();
  json["p99"] = known ? Json(error.p99) : Json();
  json["mean"] = known ? Json(error.mean) : Json();
  json["rms"] = known ? Json(error.rms) : Json();
  return json;
}

Json GroupsJson(const std::vector<ErrorGroup>& groups, const char* id_key,
                const char* name_key) {
  Json json = Json::array();
  for (const ErrorGroup& group : groups) {
    json.push_back({{id_key, group.id},
                    {name_key, group.name},
                    {"pixel_error", ErrorJson(group.error)}});
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

Json DistributionJson(const Distribution& distribution) {
  return {{"count", distribution.count},
          {"min", distribution.min},
          {"median", distribution.median},
          {"mean", distribution.mean},
          {"max", distribution.max}};
}

}  // namespace

std::string ModelTable(const ModelStatistics& statistics, int max_images) {
  TextTable overall;
  overall.AddRow({"", "observations", "max", "P99", "mean", "RMS"});
  AddErrorRow("all", statistics.pixel_error, &overall);

  std::ostringstream text;
  text << ColmapFigures(statistics) << "\nTrue reprojection errors, pixels\n"
       << overall.ToString();
  if (statistics.pixel_error.not_finite > 0) {
    text << statistics.pixel_error.not_finite
         << " more observations have no finite error; " << statistics.num_behind
         << " of all lie behind their camera.\n";
  }
  text << "\nBy camera, pixels\n"
       << ErrorTable(statistics.cameras) << "\nBy image, pixels; the "
       << std::min<size_t>(static_cast<size_t>(max_images),
                           statistics.images.size())
       << " of " << statistics.images.size() << " with the largest errors\n"
       << ErrorTable(WithLargestErrors(statistics.images,
                                       static_cast<size_t>(max_images)))
       << "\nWorst observations, pixels\n"
       << WorstTable(statistics.worst) << "\nTracks and depths\n"
       << DistributionTable(statistics)
       << statistics.num_tracks_with_repeated_image
       << " tracks hold two or more observations of one image.\n";
  return text.str();
}

std::string ModelJson(const ModelStatistics& statistics,
                      const std::string& version) {
  const Json json = {
      {"version", version},
      {"command", "model_analyzer"},
      {"num_cameras", statistics.num_cameras},
      {"num_rigs", statistics.num_rigs},
      {"num_frames", statistics.num_frames},
      {"num_images", statistics.num_images},
      {"num_points", statistics.num_points},
      {"num_observations", statistics.num_observations},
      {"mean_track_length", statistics.mean_track_length},
      {"mean_observations_per_image", statistics.mean_observations_per_image},
      {"mean_stored_error", statistics.mean_stored_error},
      {"pixel_error", ErrorJson(statistics.pixel_error)},
      {"cameras", GroupsJson(statistics.cameras, "camera_id", "model")},
      {"images", GroupsJson(statistics.images, "image_id", "image_name")},
      {"worst", WorstJson(statistics.worst)},
      {"track_length", DistributionJson(statistics.track_length)},
      {"num_tracks_with_repeated_image",
       statistics.num_tracks_with_repeated_image},
      {"depth", DistributionJson(statistics.depth)},
      {"num_behind", statistics.num_behind},
  };
  // Image names are bytes, not always UTF-8.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace krot
