#include "krot/analysis/collapse.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Core>

#include "krot/base/numbers.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;

constexpr double kDegenerate = 1e-6;
constexpr double kFall = 0.01;  // of what it was before

// Projection centres by the index of the image; none without a pose.
using Centres = std::vector<std::optional<Vector3d>>;

Centres CentresOf(const Model& model) {
  Centres centres;
  for (const ImageGeometry& image : ImageGeometries(model)) {
    centres.push_back(image.has_pose
                          ? std::optional(Center(image.cam_from_world))
                          : std::nullopt);
  }
  return centres;
}

// How the cameras that see a point lie to it; infinite with fewer than two.
struct Shape {
  double nearest = kInfinity;   // distance of a camera
  double nearness = kInfinity;  // nearest distance over the median one
  double angle = kInfinity;     // between the first ray and another, radians
};

Shape ShapeOf(const Vector3d& xyz, const std::vector<int32_t>& images,
              const Centres& centres) {
  std::vector<double> distances;
  std::optional<Vector3d> first;
  Shape shape;
  double angle = 0;
  for (const int32_t n : images) {
    if (!centres[n]) continue;
    const Vector3d ray = xyz - *centres[n];
    distances.push_back(ray.norm());
    if (!first) first = ray;
    angle =
        std::max(angle, std::atan2(first->cross(ray).norm(), first->dot(ray)));
  }
  if (distances.size() < 2 || !xyz.allFinite()) return shape;
  const auto median =
      distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), median, distances.end());
  shape.nearest = *std::min_element(distances.begin(), distances.end());
  shape.nearness = shape.nearest / *median;
  shape.angle = angle;
  return shape;
}

// Whether a value has become degenerate, and a hundred times smaller than
// before. An infinite value before means that it was not known.
bool HasFallen(double before, double after) {
  return after < kDegenerate && !(before < kDegenerate) &&
         !(after > kFall * before);
}

// The diagonal of the box around the points, relative to the distance of the
// nearest camera.
class Extent {
 public:
  void Add(const Point3D& point, const Shape& shape) {
    if (!std::isfinite(shape.nearest)) return;
    low_ = low_.cwiseMin(point.xyz);
    high_ = high_.cwiseMax(point.xyz);
    nearest_ = std::min(nearest_, shape.nearest);
  }
  double Relative(const Context& context) const {
    Vector3d size;
    for (int i = 0; i < 3; ++i) {
      size[i] = MaxOfRanks(context, high_[i]) + MaxOfRanks(context, -low_[i]);
    }
    return size.norm() / -MaxOfRanks(context, -nearest_);
  }

 private:
  Vector3d low_ = Vector3d::Constant(kInfinity);
  Vector3d high_ = Vector3d::Constant(-kInfinity);
  double nearest_ = kInfinity;
};

}  // namespace

Collapse FindCollapse(const Model& before, const Model& after,
                      const Context& context) {
  const Centres centres_before = CentresOf(before);
  const Centres centres_after = CentresOf(after);
  const auto image_indices = ImageIndices(after);
  const IdIndex<Point3DId> points_before(before.points3D);
  Extent extent_before;
  Extent extent_after;
  Collapse collapse;
  for (const Point3D& point : after.points3D) {
    std::vector<int32_t> images;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      images.push_back(image_indices.at(after.track_elements[e].image_id));
    }
    const Point3D& origin = before.points3D[*points_before.Find(point.id)];
    const Shape then = ShapeOf(origin.xyz, images, centres_before);
    const Shape now = ShapeOf(point.xyz, images, centres_after);
    if (!std::isfinite(now.nearest)) continue;
    ++collapse.num_points;
    if (HasFallen(then.nearness, now.nearness)) {
      collapse.in_camera.push_back(point.id);
    } else if (HasFallen(then.angle, now.angle)) {
      collapse.at_infinity.push_back(point.id);
    }
    extent_before.Add(origin, then);
    extent_after.Add(point, now);
  }
  collapse.num_points = SumOfRanks(context, collapse.num_points);
  if (context.ranks != nullptr) {
    collapse.in_camera = context.ranks->Gather(collapse.in_camera);
    collapse.at_infinity = context.ranks->Gather(collapse.at_infinity);
  }
  std::sort(collapse.in_camera.begin(), collapse.in_camera.end());
  std::sort(collapse.at_infinity.begin(), collapse.at_infinity.end());
  collapse.is_in_one_place =
      collapse.num_points > 1 && HasFallen(extent_before.Relative(context),
                                           extent_after.Relative(context));
  return collapse;
}

}  // namespace krot::internal
