#include "krot/analysis/model_comparison.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/analysis/model_statistics.h"
#include "krot/base/check.h"
#include "krot/base/numbers.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

ModelCounts Count(const Model& model) {
  return {static_cast<int64_t>(model.images.size()),
          static_cast<int64_t>(model.points3D.size()),
          static_cast<int64_t>(model.track_elements.size())};
}

ModelCounts Count(const ModelCorrespondence& correspondence) {
  return {static_cast<int64_t>(correspondence.images.size()),
          static_cast<int64_t>(correspondence.points.size()),
          static_cast<int64_t>(correspondence.observations.size())};
}

// The median distance of each image from the points it sees; NaN without any.
std::vector<double> TypicalDistances(const Model& model,
                                     const std::vector<ImageGeometry>& images) {
  const IdIndex<ImageId> index(model.images);
  std::vector<double> distances;
  std::vector<int32_t> image_of;
  for (const Point3D& point : model.points3D) {
    for (const TrackElement& element : TrackOf(model, point)) {
      const int32_t n = *index.Find(element.image_id);
      image_of.push_back(images[n].has_pose ? n : -1);
      distances.push_back((images[n].cam_from_world * point.xyz).norm());
    }
  }
  return GroupMedians(distances, image_of,
                      static_cast<int32_t>(model.images.size()), {});
}

// One per shared image; none if either model has no pose of it.
std::vector<std::optional<PosePair>> PosePairs(
    const Model& model1, const Model& model2,
    const ModelCorrespondence& correspondence) {
  const std::vector<ImageGeometry> images1 = ImageGeometries(model1);
  const std::vector<ImageGeometry> images2 = ImageGeometries(model2);
  const std::vector<double> distances1 = TypicalDistances(model1, images1);
  const std::vector<double> distances2 = TypicalDistances(model2, images2);
  std::vector<std::optional<PosePair>> poses;
  for (const auto& [n1, n2] : correspondence.images) {
    std::optional<PosePair>& pose = poses.emplace_back();
    if (!images1[n1].has_pose || !images2[n2].has_pose) continue;
    const RigidTransform& cam_from_world1 = images1[n1].cam_from_world;
    const RigidTransform& cam_from_world2 = images2[n2].cam_from_world;
    pose = PosePair{cam_from_world1.rotation, cam_from_world2.rotation,
                    Center(cam_from_world1),  Center(cam_from_world2),
                    distances1[n1],           distances2[n2]};
  }
  return poses;
}

std::vector<PosePair> Known(const std::vector<std::optional<PosePair>>& poses) {
  std::vector<PosePair> known;
  for (const std::optional<PosePair>& pose : poses) {
    if (pose) known.push_back(*pose);
  }
  return known;
}

PoseDifference Difference(const PosePair& pose,
                          const Similarity& world1_from_world2) {
  const Matrix3d cam2_from_world1 =
      pose.cam_from_world2_rotation * world1_from_world2.rotation.transpose();
  return {AngleDeg(pose.cam_from_world1_rotation, cam2_from_world1),
          (pose.center1 - world1_from_world2 * pose.center2).norm()};
}

// How far the alignment moves the centroid of the second model's centres.
double DistanceMoved(const std::vector<PosePair>& poses,
                     const Similarity& world1_from_world2) {
  if (poses.empty()) return 0;
  Vector3d centroid = Vector3d::Zero();
  for (const PosePair& pose : poses) centroid += pose.center2;
  centroid /= static_cast<double>(poses.size());
  return (world1_from_world2 * centroid - centroid).norm();
}

DifferenceStatistics SummarizeDifferences(std::vector<double> values) {
  DifferenceStatistics statistics;
  if (values.empty()) return statistics;
  std::sort(values.begin(), values.end());
  double sum = 0;
  double sum_of_squares = 0;
  for (const double value : values) {
    sum += value;
    sum_of_squares += value * value;
  }
  const double count = static_cast<double>(values.size());
  statistics.max = values.back();
  statistics.median = values[(values.size() - 1) / 2];
  statistics.mean = sum / count;
  statistics.rms = std::sqrt(sum_of_squares / count);
  statistics.count = static_cast<int64_t>(values.size());
  return statistics;
}

void ComparePoses(ComparisonSummary* summary) {
  std::vector<double> angles_deg;
  std::vector<double> distances;
  for (const ImageDifference& image : summary->images) {
    if (!image.pose) continue;
    angles_deg.push_back(image.pose->rotation_deg);
    distances.push_back(image.pose->center);
  }
  summary->rotation_deg = SummarizeDifferences(std::move(angles_deg));
  summary->center = SummarizeDifferences(std::move(distances));
}

void ComparePoints(const Model& model1, const Model& model2,
                   const ModelCorrespondence& correspondence, int num_worst,
                   ComparisonSummary* summary) {
  std::vector<PointDifference> moved;
  std::vector<double> distances;
  for (const IndexPair& pair : correspondence.points) {
    const Point3D& point1 = model1.points3D[pair.first];
    const Point3D& point2 = model2.points3D[pair.second];
    const double distance =
        (point1.xyz - summary->world1_from_world2 * point2.xyz).norm();
    moved.push_back({point1.id, point2.id, distance});
    distances.push_back(distance);
  }
  summary->point = SummarizeDifferences(std::move(distances));
  SortLargestFirst(&moved, &PointDifference::distance);
  moved.resize(std::min(moved.size(), static_cast<size_t>(num_worst)));
  summary->worst_points = std::move(moved);
}

// Summarises the errors of the shared observations in both models.
void CompareSharedErrors(const std::vector<ElementPair>& observations,
                         const std::vector<double>& errors1_px,
                         const std::vector<double>& errors2_px,
                         ComparisonSummary* summary) {
  std::vector<double> shared1_px;
  std::vector<double> shared2_px;
  for (const ElementPair& pair : observations) {
    shared1_px.push_back(errors1_px[pair.first]);
    shared2_px.push_back(errors2_px[pair.second]);
  }
  summary->shared_errors1 = Summarize(shared1_px);
  summary->shared_errors2 = Summarize(shared2_px);
}

}  // namespace

std::vector<PosePair> SharedPoses(const Model& model1, const Model& model2,
                                  const ModelCorrespondence& correspondence) {
  return Known(PosePairs(model1, model2, correspondence));
}

std::optional<ComparisonSummary> CompareModels(
    const Model& model1, const Model& model2,
    const ModelCorrespondence& correspondence,
    const CompareModelsOptions& options) {
  CheckArgument(options.num_worst >= 0, "options.num_worst", options.num_worst,
                ">= 0");
  const std::vector<std::optional<PosePair>> poses =
      PosePairs(model1, model2, correspondence);
  const std::vector<PosePair> known_poses = Known(poses);
  const std::optional<Similarity> world1_from_world2 =
      Align(options.alignment, known_poses);
  if (!world1_from_world2) return std::nullopt;

  ComparisonSummary summary;
  summary.model1 = Count(model1);
  summary.model2 = Count(model2);
  summary.shared = Count(correspondence);
  summary.num_shared_poses = static_cast<int64_t>(known_poses.size());
  summary.alignment = options.alignment;
  summary.world1_from_world2 = *world1_from_world2;
  const std::vector<PosePair> held_poses = HeldPoses(known_poses);
  summary.scene_radius = SceneRadius(held_poses);
  summary.moved = DistanceMoved(held_poses, *world1_from_world2);

  const std::vector<double> errors1_px =
      PixelErrors(model1, options.num_threads);
  const std::vector<double> errors2_px =
      PixelErrors(model2, options.num_threads);
  summary.errors1 = Summarize(errors1_px);
  summary.errors2 = Summarize(errors2_px);
  CompareSharedErrors(correspondence.observations, errors1_px, errors2_px,
                      &summary);

  const std::vector<ImageErrors> images1 = ErrorsByImage(model1, errors1_px);
  const std::vector<ImageErrors> images2 = ErrorsByImage(model2, errors2_px);
  for (size_t n = 0; n < correspondence.images.size(); ++n) {
    const ImageErrors& image1 = images1[correspondence.images[n].first];
    const ImageErrors& image2 = images2[correspondence.images[n].second];
    ImageDifference image{image1.image_id, image2.image_id, image1.image_name,
                          std::nullopt,    image1.errors,   image2.errors};
    if (poses[n]) image.pose = Difference(*poses[n], *world1_from_world2);
    summary.images.push_back(std::move(image));
  }
  ComparePoses(&summary);
  ComparePoints(model1, model2, correspondence, options.num_worst, &summary);
  return summary;
}

namespace {

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
  shape.nearest = *std::min_element(distances.begin(), distances.end());
  shape.nearness = shape.nearest / Median(std::move(distances));
  shape.angle = angle;
  return shape;
}

// Whether a value has become degenerate, and a hundred times smaller than
// before. An infinite value before means that it was not known.
bool HasFallen(double before, double after) {
  constexpr double kDegenerate = 1e-6;
  return after < kDegenerate && !(before < kDegenerate) &&
         !(after > 0.01 * before);
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
    for (const TrackElement& element : TrackOf(after, point)) {
      images.push_back(image_indices.at(element.image_id));
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

namespace krot {

using namespace internal;

std::optional<ComparisonSummary> CompareModels(
    const Model& model1, const Model& model2,
    const CompareModelsOptions& options) {
  return CompareModels(model1, model2, FindCorrespondence(model1, model2),
                       options);
}

}  // namespace krot
