#include "krot/report/model_statistics.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <unordered_map>
#include <utility>

#include "krot/base/check.h"
#include "krot/camera/camera_model.h"
#include "krot/model/image_geometry.h"

namespace krot {
namespace {

// All observations, in the order of Model::track_elements.
struct ObservationTable {
  std::vector<int32_t> image;  // index in Model::images
  std::vector<int32_t> point;  // index in Model::points3D
  std::vector<double> depth;   // scene units; NaN without a pose
  std::vector<double> error_px;
};

ObservationTable TabulateObservations(const Model& model, int num_threads) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const std::unordered_map<ImageId, int32_t> image_of_id = ImageIndices(model);
  ObservationTable table;
  table.error_px = PixelErrors(model, num_threads);
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const Point3D& point = model.points3D[k];
    for (uint64_t n = point.track_begin; n < point.track_end; ++n) {
      const int32_t image = image_of_id.at(model.track_elements[n].image_id);
      const ImageGeometry& geometry = geometries[image];
      const double depth =
          geometry.has_pose
              ? geometry.cam_from_world_rotation.row(2).dot(point.xyz) +
                    geometry.cam_from_world_translation.z()
              : std::nan("");
      table.image.push_back(image);
      table.point.push_back(static_cast<int32_t>(k));
      table.depth.push_back(depth);
    }
  }
  return table;
}

Distribution Describe(std::vector<double> values) {
  Distribution distribution;
  if (values.empty()) return distribution;
  std::sort(values.begin(), values.end());
  distribution.count = static_cast<int64_t>(values.size());
  distribution.min = values.front();
  distribution.median = values[(values.size() - 1) / 2];
  distribution.mean = std::accumulate(values.begin(), values.end(), 0.0) /
                      static_cast<double>(values.size());
  distribution.max = values.back();
  return distribution;
}

double Ratio(double numerator, int64_t denominator) {
  return denominator == 0 ? 0 : numerator / static_cast<double>(denominator);
}

void CountRecords(const Model& model, ModelStatistics* statistics) {
  statistics->num_cameras = static_cast<int64_t>(model.cameras.size());
  statistics->num_rigs = static_cast<int64_t>(model.rigs.size());
  statistics->num_frames = static_cast<int64_t>(model.frames.size());
  statistics->num_images = static_cast<int64_t>(model.images.size());
  statistics->num_points = static_cast<int64_t>(model.points3D.size());
  statistics->num_observations =
      static_cast<int64_t>(model.track_elements.size());
  const double num_observations =
      static_cast<double>(statistics->num_observations);
  statistics->mean_track_length =
      Ratio(num_observations, statistics->num_points);
  statistics->mean_observations_per_image =
      Ratio(num_observations, statistics->num_images);

  double sum = 0;
  int64_t count = 0;
  for (const Point3D& point : model.points3D) {
    if (point.error == -1) continue;
    sum += point.error;
    ++count;
  }
  statistics->mean_stored_error = Ratio(sum, count);
}

std::vector<ErrorGroup> ErrorsByImage(const Model& model,
                                      const ObservationTable& table) {
  std::vector<std::vector<double>> errors(model.images.size());
  for (size_t n = 0; n < table.image.size(); ++n) {
    errors[table.image[n]].push_back(table.error_px[n]);
  }
  std::vector<ErrorGroup> groups;
  for (size_t i = 0; i < model.images.size(); ++i) {
    const Image& image = model.images[i];
    groups.push_back({image.id, image.name, Summarize(errors[i])});
  }
  return groups;
}

std::vector<ErrorGroup> ErrorsByCamera(const Model& model,
                                       const ObservationTable& table) {
  std::unordered_map<CameraId, std::vector<double>> errors;
  for (size_t n = 0; n < table.image.size(); ++n) {
    const Image& image = model.images[table.image[n]];
    errors[image.camera_id].push_back(table.error_px[n]);
  }
  std::vector<ErrorGroup> groups;
  for (const Camera& camera : model.cameras) {
    const CameraModelInfo* info = FindCameraModel(camera.model_id);
    groups.push_back(
        {camera.id, std::string(info->name), Summarize(errors[camera.id])});
  }
  return groups;
}

std::vector<WorstObservation> FindWorst(const Model& model,
                                        const ObservationTable& table,
                                        size_t num_worst) {
  std::vector<size_t> order;
  for (size_t n = 0; n < table.error_px.size(); ++n) {
    if (std::isfinite(table.error_px[n])) order.push_back(n);
  }
  num_worst = std::min(num_worst, order.size());
  std::partial_sort(order.begin(), order.begin() + num_worst, order.end(),
                    [&](size_t a, size_t b) {
                      return std::make_pair(-table.error_px[a], a) <
                             std::make_pair(-table.error_px[b], b);
                    });
  std::vector<WorstObservation> worst;
  for (size_t i = 0; i < num_worst; ++i) {
    const size_t n = order[i];
    const Image& image = model.images[table.image[n]];
    worst.push_back({image.id, image.name, model.track_elements[n].point2D_idx,
                     model.points3D[table.point[n]].id, table.error_px[n]});
  }
  return worst;
}

bool RepeatsAnImage(const Model& model, const Point3D& point) {
  std::set<ImageId> images;
  for (uint64_t n = point.track_begin; n < point.track_end; ++n) {
    if (!images.insert(model.track_elements[n].image_id).second) return true;
  }
  return false;
}

void DescribeTracks(const Model& model, ModelStatistics* statistics) {
  std::vector<double> lengths;
  for (const Point3D& point : model.points3D) {
    lengths.push_back(static_cast<double>(point.track_end - point.track_begin));
    statistics->num_tracks_with_repeated_image += RepeatsAnImage(model, point);
  }
  statistics->track_length = Describe(std::move(lengths));
}

void DescribeDepths(const ObservationTable& table,
                    ModelStatistics* statistics) {
  std::vector<double> depths;
  for (const double depth : table.depth) {
    if (!std::isfinite(depth)) continue;
    depths.push_back(depth);
    statistics->num_behind += depth <= 0;
  }
  statistics->depth = Describe(std::move(depths));
}

}  // namespace

ModelStatistics AnalyzeModel(const Model& model, int num_worst,
                             int num_threads) {
  CheckArgument(num_worst >= 0, "num_worst", num_worst, ">= 0");
  const ObservationTable table = TabulateObservations(model, num_threads);
  ModelStatistics statistics;
  CountRecords(model, &statistics);
  statistics.pixel_error = Summarize(table.error_px);
  statistics.images = ErrorsByImage(model, table);
  statistics.cameras = ErrorsByCamera(model, table);
  statistics.worst = FindWorst(model, table, static_cast<size_t>(num_worst));
  DescribeTracks(model, &statistics);
  DescribeDepths(table, &statistics);
  return statistics;
}

}  // namespace krot
