#include "krot/analysis/model_statistics.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <unordered_map>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "krot/analysis/noise.h"
#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/camera/camera_model.h"
#include "krot/minimax/residual_set.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

// The errors of the track elements, gathered by the index of their image.
std::vector<std::vector<double>> GroupByImage(
    const Model& model, const std::vector<double>& errors_px) {
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  std::vector<std::vector<double>> groups(model.images.size());
  for (size_t e = 0; e < errors_px.size(); ++e) {
    groups[image_of[e]].push_back(errors_px[e]);
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
  std::vector<size_t> elements;
  for (size_t e = 0; e < errors_px.size(); ++e) {
    if (std::isfinite(errors_px[e])) elements.push_back(e);
  }
  const size_t num_listed =
      std::min(elements.size(), static_cast<size_t>(count));
  std::partial_sort(elements.begin(), elements.begin() + num_listed,
                    elements.end(), [&](size_t a, size_t b) {
                      return std::pair(-errors_px[a], a) <
                             std::pair(-errors_px[b], b);
                    });
  elements.resize(num_listed);

  const std::vector<int32_t> image_of = ImagesOfElements(model);
  const std::vector<int32_t> point_of = PointsOfElements(model);
  std::vector<WorstObservation> worst;
  for (const size_t e : elements) {
    const TrackElement& element = model.track_elements[e];
    worst.push_back({element.image_id, model.images[image_of[e]].name,
                     element.point2D_idx, model.points3D[point_of[e]].id,
                     errors_px[e]});
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

std::vector<DiscardedCamera> FindDiscardedCameras(const Model& model) {
  std::set<CameraId> seen;
  for (const int32_t n : ImagesOfElements(model)) {
    seen.insert(model.images[n].camera_id);
  }
  std::vector<DiscardedCamera> discarded;
  for (const Camera& camera : model.cameras) {
    const CameraModelInfo& info = *FindCameraModel(camera.model_id);
    const uint64_t side = std::max(camera.width, camera.height);
    if (seen.count(camera.id) == 0 || side == 0 || !info.has_image_plane) {
      continue;
    }
    for (int i = 0; i < info.num_focal_lengths(); ++i) {
      const double ratio = camera.params[i] / static_cast<double>(side);
      if (ratio >= 0.1 && ratio <= 10) continue;
      discarded.push_back({camera.id, camera.params[i], side});
      break;
    }
  }
  return discarded;
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
    for (const TrackElement& element : TrackOf(model, point)) {
      const ImageGeometry& image = geometries[indices.at(element.image_id)];
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
  ParallelForEach(
      static_cast<int64_t>(angles.size()), num_threads, [&](int64_t k) {
        std::vector<Vector3d> rays;
        const Point3D& point = model.points3D[k];
        for (const TrackElement& element : TrackOf(model, point)) {
          const ImageGeometry& image = geometries[indices.at(element.image_id)];
          if (!image.has_pose) continue;
          rays.push_back(Center(image.cam_from_world) - point.xyz);
        }
        angles[k] = LargestAngle(rays);
      });
  angles.erase(std::remove(angles.begin(), angles.end(), kNoAngle),
               angles.end());
  for (double& angle : angles) angle *= kDegreesPerRadian;
  return RangeOf(std::move(angles));
}

}  // namespace krot::internal

namespace krot {

using namespace internal;

namespace {

// x_cam = q x q^-1 + t.
struct CameraPose {
  Eigen::Quaterniond rotation;
  Eigen::Vector3d translation;
};

// Normalised when read and again when used, and applied to points as a
// quaternion: these are the operations of COLMAP 3.8. Where a point nearly
// coincides with a camera centre, rounding decides its error, and should decide
// alike.
Eigen::Quaterniond NormalizedTwice(const Pose& pose) {
  Eigen::Vector4d q(pose.quaternion_wxyz.data());
  q /= q.norm();
  q /= q.norm();
  return {q[0], q[1], q[2], q[3]};
}

std::optional<CameraPose> CameraPoseOf(const Model& model,
                                       const ImageGeometry& geometry) {
  if (!geometry.has_pose) return std::nullopt;
  const bool is_frame_pose =
      geometry.cam_from_rig.rotation == Eigen::Matrix3d::Identity() &&
      geometry.cam_from_rig.translation == Eigen::Vector3d::Zero();
  if (!is_frame_pose) {
    return CameraPose{Eigen::Quaterniond(geometry.cam_from_world.rotation),
                      geometry.cam_from_world.translation};
  }
  const Pose& pose = model.frames[geometry.frame].rig_from_world;
  return CameraPose{NormalizedTwice(pose), pose.translation};
}

double PixelError(const CameraPose& pose, const Camera& camera,
                  const Point2D& point2D, const Eigen::Vector3d& xyz,
                  Norm norm) {
  const Eigen::Vector3d x_cam = pose.rotation * xyz + pose.translation;
  const std::optional<Eigen::Vector2d> difference =
      ProjectionError(camera, {point2D.x, point2D.y}, x_cam);
  if (!difference) return kNaN;
  const double error = NormOf(*difference, norm);
  return std::isfinite(error) ? error : kNaN;
}

}  // namespace

std::vector<double> PixelErrors(const Model& model, int num_threads,
                                Norm norm) {
  const std::unordered_map<ImageId, int32_t> image_indices =
      ImageIndices(model);
  std::vector<std::optional<CameraPose>> poses;
  std::vector<const Camera*> cameras;
  for (const ImageGeometry& geometry : ImageGeometries(model)) {
    poses.push_back(CameraPoseOf(model, geometry));
    cameras.push_back(&model.cameras[geometry.camera]);
  }

  std::vector<double> errors_px(model.track_elements.size(), kNaN);
  ParallelFor(
      static_cast<int64_t>(model.points3D.size()), kItemsPerChunk, num_threads,
      [&](int64_t begin, int64_t end, int) {
        for (int64_t k = begin; k < end; ++k) {
          const Point3D& point = model.points3D[k];
          for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
            const TrackElement& element = model.track_elements[e];
            const int32_t n = image_indices.at(element.image_id);
            if (!poses[n]) continue;
            errors_px[e] = PixelError(
                *poses[n], *cameras[n],
                model.images[n].points2D[element.point2D_idx], point.xyz, norm);
          }
        }
      });
  return errors_px;
}

PixelErrorStatistics Summarize(const std::vector<double>& errors_px) {
  std::vector<double> finite;
  finite.reserve(errors_px.size());
  double sum = 0;
  double sum_of_squares = 0;
  for (const double error : errors_px) {
    if (!std::isfinite(error)) continue;
    finite.push_back(error);
    sum += error;
    sum_of_squares += error * error;
  }

  PixelErrorStatistics statistics;
  statistics.count = static_cast<int64_t>(finite.size());
  statistics.not_finite =
      static_cast<int64_t>(errors_px.size()) - statistics.count;
  if (finite.empty()) return statistics;
  const double count = static_cast<double>(finite.size());
  statistics.mean = sum / count;
  statistics.rms = std::sqrt(sum_of_squares / count);
  // ceil(0.99 n)-th smallest, in integers.
  const auto rank = finite.begin() + ((99 * statistics.count + 99) / 100 - 1);
  std::nth_element(finite.begin(), rank, finite.end());
  statistics.p99 = *rank;
  statistics.max = *std::max_element(rank, finite.end());
  return statistics;
}

void UpdatePointErrors(const std::vector<double>& errors_px, Model* model) {
  CheckArgument(errors_px.size() == model->track_elements.size(),
                "errors_px.size()", errors_px.size(),
                "the number of track elements");
  for (Point3D& point : model->points3D) {
    double sum = 0;
    int64_t count = 0;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!std::isfinite(errors_px[e])) continue;
      sum += errors_px[e];
      ++count;
    }
    point.error = count > 0 ? sum / static_cast<double>(count) : -1;
  }
}

}  // namespace krot
