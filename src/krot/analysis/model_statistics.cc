#include "krot/analysis/model_statistics.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

// The errors of the track elements, gathered by the index of their image.
std::vector<std::vector<double>> GroupByImage(
    const Model& model, const std::vector<double>& errors_px) {
  const std::unordered_map<ImageId, int32_t> indices = ImageIndices(model);
  std::vector<std::vector<double>> groups(model.images.size());
  for (size_t e = 0; e < errors_px.size(); ++e) {
    groups[indices.at(model.track_elements[e].image_id)].push_back(
        errors_px[e]);
  }
  return groups;
}

double Ratio(double numerator, int64_t denominator) {
  return denominator > 0 ? numerator / static_cast<double>(denominator) : 0;
}

// An error stored as -1 means that there is none.
double MeanStoredError(const std::vector<Point3D>& points) {
  double sum = 0;
  int64_t count = 0;
  for (const Point3D& point : points) {
    if (point.error == -1) continue;
    sum += point.error;
    ++count;
  }
  return Ratio(sum, count);
}

}  // namespace

ColmapStatistics ComputeColmapStatistics(const Model& model) {
  ColmapStatistics statistics;
  if (model.stores_rigs) {
    statistics.num_rigs = static_cast<int64_t>(model.rigs.size());
    statistics.num_frames = static_cast<int64_t>(model.frames.size());
  }
  statistics.num_cameras = static_cast<int64_t>(model.cameras.size());
  statistics.num_images = static_cast<int64_t>(model.images.size());
  statistics.num_points = static_cast<int64_t>(model.points3D.size());

  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  for (size_t n = 0; n < model.images.size(); ++n) {
    if (!geometries[n].has_pose) continue;
    ++statistics.num_registered_images;
    const std::vector<Point2D>& points2D = model.images[n].points2D;
    statistics.num_observations += std::count_if(
        points2D.begin(), points2D.end(),
        [](const Point2D& p) { return p.point3D_id != kInvalidPoint3DId; });
  }
  const double num_observations =
      static_cast<double>(statistics.num_observations);
  statistics.mean_track_length = Ratio(num_observations, statistics.num_points);
  statistics.mean_observations_per_image =
      Ratio(num_observations, statistics.num_registered_images);
  statistics.mean_reprojection_error = MeanStoredError(model.points3D);
  return statistics;
}

std::vector<ImageErrors> ErrorsByImage(const Model& model,
                                       const std::vector<double>& errors_px) {
  const std::vector<std::vector<double>> groups =
      GroupByImage(model, errors_px);
  std::vector<ImageErrors> by_image;
  for (size_t n = 0; n < groups.size(); ++n) {
    by_image.push_back({model.images[n].id, model.images[n].name,
                        model.images[n].camera_id, Summarize(groups[n])});
  }
  return by_image;
}

std::vector<CameraErrors> ErrorsByCamera(const Model& model,
                                         const std::vector<double>& errors_px) {
  const std::vector<std::vector<double>> by_image =
      GroupByImage(model, errors_px);
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  std::vector<std::vector<double>> groups(model.cameras.size());
  std::vector<int64_t> num_images(model.cameras.size(), 0);
  for (size_t n = 0; n < by_image.size(); ++n) {
    std::vector<double>& group = groups[geometries[n].camera];
    group.insert(group.end(), by_image[n].begin(), by_image[n].end());
    ++num_images[geometries[n].camera];
  }
  std::vector<CameraErrors> by_camera;
  for (size_t c = 0; c < groups.size(); ++c) {
    by_camera.push_back(
        {model.cameras[c].id, num_images[c], Summarize(groups[c])});
  }
  return by_camera;
}

std::vector<WorstObservation> WorstObservations(
    const Model& model, const std::vector<double>& errors_px, int count) {
  struct Candidate {
    size_t element;
    size_t point;
  };
  std::vector<Candidate> candidates;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const Point3D& point = model.points3D[k];
    for (size_t e = point.track_begin; e < point.track_end; ++e) {
      if (std::isfinite(errors_px[e])) candidates.push_back({e, k});
    }
  }
  const size_t num_listed =
      std::min(candidates.size(), static_cast<size_t>(count));
  std::partial_sort(candidates.begin(), candidates.begin() + num_listed,
                    candidates.end(),
                    [&](const Candidate& a, const Candidate& b) {
                      if (errors_px[a.element] != errors_px[b.element]) {
                        return errors_px[a.element] > errors_px[b.element];
                      }
                      return a.element < b.element;
                    });
  candidates.resize(num_listed);

  const std::unordered_map<ImageId, int32_t> indices = ImageIndices(model);
  std::vector<WorstObservation> worst;
  for (const Candidate& candidate : candidates) {
    const TrackElement& element = model.track_elements[candidate.element];
    worst.push_back({element.image_id,
                     model.images[indices.at(element.image_id)].name,
                     element.point2D_idx, model.points3D[candidate.point].id,
                     errors_px[candidate.element]});
  }
  return worst;
}

namespace {

using Eigen::Vector3d;

constexpr double kNoAngle = -1;

ValueRange RangeOf(std::vector<double> values) {
  if (values.empty()) return {};
  const auto [min, max] = std::minmax_element(values.begin(), values.end());
  return {*min, LowerMedian(values), *max, static_cast<int64_t>(values.size())};
}

// atan2 keeps small angles exact, where acos would lose half the digits.
double Angle(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

double LargestAngle(const std::vector<Vector3d>& rays) {
  double largest = kNoAngle;
  for (size_t i = 0; i < rays.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      largest = std::max(largest, Angle(rays[i], rays[j]));
    }
  }
  return largest;
}

}  // namespace

std::map<int64_t, int64_t> TrackLengthHistogram(const Model& model) {
  std::map<int64_t, int64_t> histogram;
  for (const Point3D& point : model.points3D) {
    ++histogram[static_cast<int64_t>(point.track_end - point.track_begin)];
  }
  return histogram;
}

std::vector<std::optional<OddFocalLength>> FindOddFocalLengths(
    const Model& model) {
  std::vector<std::vector<size_t>> images_of(model.cameras.size());
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  for (size_t n = 0; n < geometries.size(); ++n) {
    if (geometries[n].camera >= 0) images_of[geometries[n].camera].push_back(n);
  }
  std::map<std::tuple<int, uint64_t, uint64_t>, std::vector<size_t>> kinds;
  for (size_t c = 0; c < model.cameras.size(); ++c) {
    const Camera& camera = model.cameras[c];
    if (images_of[c].size() != 1 || !(camera.params.at(0) > 0)) continue;
    kinds[{camera.model_id, camera.width, camera.height}].push_back(c);
  }
  std::vector<std::optional<OddFocalLength>> odd(model.images.size());
  for (const auto& [kind, cameras] : kinds) {
    if (cameras.size() < 5) continue;
    std::vector<double> logs, deviations;
    for (const size_t c : cameras) {
      logs.push_back(std::log(model.cameras[c].params[0]));
    }
    const double median = Median(logs);
    for (const double log : logs) deviations.push_back(std::abs(log - median));
    const double least = std::max(std::log(1.1), 3 * Median(deviations));
    for (size_t n = 0; n < cameras.size(); ++n) {
      if (deviations[n] <= least) continue;
      odd[images_of[cameras[n]].front()] = {std::exp(logs[n]),
                                            std::exp(median)};
    }
  }
  return odd;
}

DepthStatistics ComputeDepthStatistics(const Model& model) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const std::unordered_map<ImageId, int32_t> indices = ImageIndices(model);
  int64_t num_not_positive = 0;
  std::vector<double> depths;
  depths.reserve(model.track_elements.size());
  for (const Point3D& point : model.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const ImageGeometry& image =
          geometries[indices.at(model.track_elements[e].image_id)];
      if (!image.has_pose) continue;
      depths.push_back(image.cam_from_world.rotation.row(2).dot(point.xyz) +
                       image.cam_from_world.translation.z());
      num_not_positive += !(depths.back() > 0);
    }
  }
  return {RangeOf(std::move(depths)), num_not_positive};
}

ValueRange TriangulationAnglesDeg(const Model& model, int num_threads) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const std::unordered_map<ImageId, int32_t> indices = ImageIndices(model);
  std::vector<double> angles(model.points3D.size(), kNoAngle);
  ParallelFor(
      static_cast<int64_t>(angles.size()), kItemsPerChunk, num_threads,
      [&](int64_t begin, int64_t end, int) {
        std::vector<Vector3d> rays;
        for (int64_t k = begin; k < end; ++k) {
          const Point3D& point = model.points3D[k];
          rays.clear();
          for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
            const ImageGeometry& image =
                geometries[indices.at(model.track_elements[e].image_id)];
            if (!image.has_pose) continue;
            rays.push_back(Center(image.cam_from_world) - point.xyz);
          }
          angles[k] = LargestAngle(rays);
        }
      });
  angles.erase(std::remove(angles.begin(), angles.end(), kNoAngle),
               angles.end());
  for (double& angle : angles) angle *= kDegreesPerRadian;
  return RangeOf(std::move(angles));
}

}  // namespace krot::internal
