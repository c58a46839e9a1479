#include "krot/analysis/geometry_statistics.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/model/image_geometry.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

constexpr int64_t kAnglesPerChunk = 256;
constexpr double kNoAngle = -1;

struct Range {
  double min = 0;
  double median = 0;
  double max = 0;
};

Range RangeOf(std::vector<double> values) {
  if (values.empty()) return Range();
  const auto [min, max] = std::minmax_element(values.begin(), values.end());
  Range range{*min, 0, *max};
  const auto middle = values.begin() + (values.size() - 1) / 2;
  std::nth_element(values.begin(), middle, values.end());
  range.median = *middle;
  return range;
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

DepthStatistics ComputeDepthStatistics(const Model& model) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const std::unordered_map<ImageId, int32_t> indices = ImageIndices(model);
  DepthStatistics statistics;
  std::vector<double> depths;
  depths.reserve(model.track_elements.size());
  for (const Point3D& point : model.points3D) {
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const ImageGeometry& image =
          geometries[indices.at(model.track_elements[e].image_id)];
      if (!image.has_pose) continue;
      depths.push_back(image.cam_from_world.rotation.row(2).dot(point.xyz) +
                       image.cam_from_world.translation.z());
      statistics.not_positive += !(depths.back() > 0);
    }
  }
  statistics.count = static_cast<int64_t>(depths.size());
  const Range range = RangeOf(std::move(depths));
  statistics.min = range.min;
  statistics.median = range.median;
  statistics.max = range.max;
  return statistics;
}

TriangulationAngleStatistics ComputeTriangulationAngleStatistics(
    const Model& model, int num_threads) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const std::unordered_map<ImageId, int32_t> indices = ImageIndices(model);
  std::vector<double> angles(model.points3D.size(), kNoAngle);
  ParallelFor(
      static_cast<int64_t>(angles.size()), kAnglesPerChunk, num_threads,
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
  TriangulationAngleStatistics statistics;
  statistics.count = static_cast<int64_t>(angles.size());
  const Range range = RangeOf(std::move(angles));
  statistics.min_deg = range.min * kDegreesPerRadian;
  statistics.median_deg = range.median * kDegreesPerRadian;
  statistics.max_deg = range.max * kDegreesPerRadian;
  return statistics;
}

}  // namespace krot::internal
