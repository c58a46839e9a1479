#include "krot/analysis/model_statistics.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "krot/base/check.h"
#include "krot/model/image_geometry.h"

namespace krot::internal {
namespace {

void CheckErrors(const Model& model, const std::vector<double>& errors_px) {
  CheckArgument(errors_px.size() == model.track_elements.size(),
                "errors_px.size()", errors_px.size(),
                "the number of track elements");
}

// The errors of the track elements, gathered by the index of their image.
std::vector<std::vector<double>> GroupByImage(
    const Model& model, const std::vector<double>& errors_px) {
  CheckErrors(model, errors_px);
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
  CheckErrors(model, errors_px);
  CheckArgument(count >= 0, "count", count, ">= 0");
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

}  // namespace krot::internal
