#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "krot/analysis/noise.h"
#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/camera/camera_model.h"
#include "krot/check.h"
#include "krot/geometry/transform.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// The right reading lowers the median error of a wrong model by more than this
// factor; so do some of the many wrong ones, by chance, but not to less than
// this share of the photo's size. Poses from a phone's sensors are as good.
constexpr double kClearly = 4;
constexpr double kFits = 0.01;
constexpr int64_t kNumTracks = 200;  // that are asked, evenly spread

// The rotations that take axes to axes.
std::vector<Matrix3d> AxisRotations() {
  std::vector<Matrix3d> rotations;
  for (const int i : {0, 1, 2}) {
    for (const int j : {(i + 1) % 3, (i + 2) % 3}) {
      for (const int signs : {0, 1, 2, 3}) {
        const Vector3d x = ((signs & 1) != 0 ? -1 : 1) * Vector3d::Unit(i);
        const Vector3d y = ((signs & 2) != 0 ? -1 : 1) * Vector3d::Unit(j);
        rotations.emplace_back() << x, y, x.cross(y);
      }
    }
  }
  return rotations;
}

// How many things differ from COLMAP's; points are another matter.
int NumDifferences(const Conventions& one) {
  return one.has_w_last + (one.is_world_from_cam || one.has_centers) +
         (one.is_left_handed || !one.cam_from_file_axes.isIdentity()) +
         (one.intrinsics_factor != 1) + one.has_central_principal_point;
}

// COLMAP's own first.
std::vector<Conventions> AllIntrinsics() {
  std::vector<Conventions> all;
  for (const double factor : {1.0, 0.5, 2.0, 0.25, 4.0, 0.125, 8.0}) {
    for (const bool is_central : {false, true}) {
      Conventions& one = all.emplace_back();
      one.intrinsics_factor = factor;
      one.has_central_principal_point = is_central;
    }
  }
  return all;
}

// All readings of the poses with these intrinsics.
std::vector<Conventions> AllPoses(const Conventions& intrinsics) {
  std::vector<Conventions> all;
  for (int bits = 0; bits < 16; ++bits) {
    for (const Matrix3d& cam_from_file_axes : AxisRotations()) {
      Conventions& one = all.emplace_back(intrinsics);
      one.has_w_last = (bits & 1) != 0;
      one.is_world_from_cam = (bits & 2) != 0;
      one.has_centers = (bits & 4) != 0;
      one.is_left_handed = (bits & 8) != 0;
      one.cam_from_file_axes = cam_from_file_axes;
    }
  }
  return all;
}

const Matrix3d kMirror = Vector3d(1, -1, 1).asDiagonal();

RigidTransform ConvertPose(const Pose& pose, const Conventions& from) {
  QuaternionWxyz wxyz = pose.quaternion_wxyz;
  if (from.has_w_last) wxyz = {wxyz[3], wxyz[0], wxyz[1], wxyz[2]};
  Matrix3d rotation = RotationOf(wxyz);
  if (from.is_world_from_cam) rotation.transposeInPlace();
  Vector3d translation = pose.translation;
  if (from.has_centers) translation = -rotation * translation;
  if (from.is_left_handed) {
    rotation = kMirror * rotation * kMirror;
    translation = kMirror * translation;
  }
  return {from.cam_from_file_axes * rotation,
          from.cam_from_file_axes * translation};
}

Camera ConvertCamera(const Camera& camera, const Conventions& from) {
  Camera converted = camera;
  const CameraModelInfo& info = *FindCameraModel(camera.model_id);
  if (!info.has_image_plane) return camera;
  const double factor = from.intrinsics_factor;
  converted.width = std::llround(factor * static_cast<double>(camera.width));
  converted.height = std::llround(factor * static_cast<double>(camera.height));
  const size_t center = info.param_names.substr(0, 2) == "fx" ? 2 : 1;
  for (size_t i = 0; i < center + 2; ++i) converted.params[i] *= factor;
  if (from.has_central_principal_point) {
    converted.params[center] = static_cast<double>(converted.width) / 2;
    converted.params[center + 1] = static_cast<double>(converted.height) / 2;
  }
  return converted;
}

void AddBearing(const RigidTransform& cam_from_world, const Vector3d& bearing,
                NearestPoint* nearest) {
  nearest->Add(Center(cam_from_world),
               cam_from_world.rotation.transpose() * bearing, 1);
}

Eigen::Vector2d PixelOf(const Model& model, int32_t image, uint64_t e) {
  const uint32_t i = model.track_elements[e].point2D_idx;
  const Point2D& pixel = model.images[image].points2D[i];
  return {pixel.x, pixel.y};
}

struct Sight {
  int32_t image = -1;
  Eigen::Vector2d pixel;
};

// Reads a sample of a model's tracks, or of a database's matches, as different
// programs would have written the model.
class ConventionSearch {
 public:
  ConventionSearch(const Model& model, const Database* database)
      : model_(model), geometries_(ImageGeometries(model)) {
    std::vector<int> num_images(model.frames.size(), 0);
    for (const ImageGeometry& geometry : geometries_) {
      if (!geometry.has_pose) continue;
      has_own_poses_ = has_own_poses_ && geometry.sensor < 0 &&
                       ++num_images[geometry.frame] == 1;
    }
    TakeTracks();
    if (tracks_.empty() && database != nullptr) TakeMatches(*database);
  }

  std::optional<Conventions> Run(const Context& context) const {
    const bool is_in_one_place = std::all_of(
        geometries_.begin(), geometries_.end(), [](const ImageGeometry& one) {
          return !one.has_pose || one.cam_from_world.translation.isZero();
        });
    if (is_in_one_place) return std::nullopt;
    // With points where their images see them, and as they stand.
    const double seen = MedianErrorWhereSeen({}, LensesIn({}));
    const double as_read =
        places_.empty() ? seen
                        : MedianError(model_.cameras, Poses({}),
                                      [&](size_t k) { return places_[k]; });
    if (as_read <= kFilteredPx) return std::nullopt;
    for (const Conventions& intrinsics : AllIntrinsics()) {
      Conventions best = SimplestOfBest(MeasureAll(intrinsics, context));
      // If points alone are wrong, the poses are as good as COLMAP's.
      const double limit = NumDifferences(best) == 0
                               ? kFilteredPx
                               : std::min(kFits * largest_px_, seen / kClearly);
      if (best.median_error_px <= std::min(limit, as_read / kClearly)) {
        best.median_error_as_read_px = as_read;
        best.has_wrong_points = HasWrongPoints(best);
        return best;
      }
      if (seen <= kFits * largest_px_) break;  // wrong intrinsics do worse
    }
    return std::nullopt;
  }

 private:
  // Points may be right where poses are read wrongly.
  bool HasWrongPoints(const Conventions& from) const {
    if (places_.empty()) return false;
    const double error = MedianError(Cameras(from), Poses(from), [&](size_t k) {
      return std::optional(from.is_left_handed ? Vector3d(kMirror * *places_[k])
                                               : *places_[k]);
    });
    return error > std::max(kFilteredPx, kClearly * from.median_error_px);
  }

  std::optional<Sight> SightOf(int32_t image, const Eigen::Vector2d& pixel) {
    if (!geometries_[image].has_pose) return std::nullopt;
    largest_px_ = std::fmax(largest_px_, pixel.cwiseAbs().maxCoeff());
    images_.insert(image);
    return Sight{image, pixel};
  }

  void TakeTracks() {
    const std::vector<int32_t> image_of = ImagesOfElements(model_);
    const auto num = static_cast<int64_t>(model_.points3D.size());
    const int64_t num_taken = std::min(num, kNumTracks);
    for (int64_t i = 0; i < num_taken; ++i) {
      const Point3D& point = model_.points3D[i * num / num_taken];
      std::vector<Sight> track;
      for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
        const int32_t n = image_of[e];
        const auto sight = SightOf(n, PixelOf(model_, n, e));
        if (sight) track.push_back(*sight);
      }
      if (track.size() < 2) continue;
      tracks_.push_back(std::move(track));
      places_.emplace_back(point.xyz);
    }
  }

  void TakeMatches(const Database& database) {
    int64_t num = 0;
    for (const VerifiedPair& pair : database.pairs) {
      num += static_cast<int64_t>(pair.matches.size());
    }
    const int64_t step = num / kNumTracks + 1;
    int64_t passed = 0;
    for (const VerifiedPair& pair : database.pairs) {
      for (const auto& match : pair.matches) {
        if (passed++ % step != 0) continue;
        const auto first =
            SightOf(pair.image1, database.keypoints[pair.image1][match[0]]);
        const auto second =
            SightOf(pair.image2, database.keypoints[pair.image2][match[1]]);
        if (first && second) tracks_.push_back({*first, *second});
      }
    }
  }

  // Of the images that see tracks; all others are left at the identity.
  std::vector<RigidTransform> Poses(const Conventions& from) const {
    std::vector<RigidTransform> poses(geometries_.size());
    for (const int32_t n : images_) {
      poses[n] =
          has_own_poses_
              ? ConvertPose(model_.frames[geometries_[n].frame].rig_from_world,
                            from)
              : geometries_[n].cam_from_world;
    }
    return poses;
  }

  std::vector<Camera> Cameras(const Conventions& from) const {
    std::vector<Camera> cameras;
    for (const Camera& camera : model_.cameras) {
      cameras.push_back(ConvertCamera(camera, from));
    }
    return cameras;
  }

  std::vector<Conventions> MeasureAll(const Conventions& intrinsics,
                                      const Context& context) const {
    const Lenses lenses = LensesIn(intrinsics);
    std::vector<Conventions> all =
        has_own_poses_ ? AllPoses(intrinsics) : std::vector{intrinsics};
    ParallelForEach(
        static_cast<int64_t>(all.size()), context.num_threads,
        [&](int64_t n) {
          all[n].median_error_px = MedianErrorWhereSeen(all[n], lenses);
        },
        /*chunk_size=*/16);
    return all;
  }

  static Conventions SimplestOfBest(const std::vector<Conventions>& all) {
    double lowest = kInfinity;
    for (const Conventions& one : all)
      lowest = std::min(lowest, one.median_error_px);
    const Conventions* simplest = nullptr;
    for (const Conventions& one : all) {
      if (one.median_error_px > 2 * lowest) continue;
      if (simplest == nullptr ||
          NumDifferences(one) < NumDifferences(*simplest)) {
        simplest = &one;
      }
    }
    return *simplest;
  }

  struct Lenses {
    std::vector<Camera> cameras;
    // Of all tracks' pixels, in camera axes; none where the lens has none.
    std::vector<std::vector<std::optional<Vector3d>>> bearings;
  };
  Lenses LensesIn(const Conventions& from) const {
    Lenses lenses = {Cameras(from), {}};
    for (const std::vector<Sight>& track : tracks_) {
      auto& bearings = lenses.bearings.emplace_back();
      for (const Sight& sight : track) {
        bearings.push_back(
            PixelBearing(CameraOf(sight, lenses.cameras), sight.pixel));
      }
    }
    return lenses;
  }

  double MedianErrorWhereSeen(const Conventions& from,
                              const Lenses& lenses) const {
    const std::vector<RigidTransform> poses = Poses(from);
    return MedianError(lenses.cameras, poses, [&](size_t k) {
      NearestPoint nearest;
      for (size_t i = 0; i < tracks_[k].size(); ++i) {
        const std::optional<Vector3d>& bearing = lenses.bearings[k][i];
        if (!bearing) return std::optional<Vector3d>();
        AddBearing(poses[tracks_[k][i].image], *bearing, &nearest);
      }
      return nearest.Solve();
    });
  }

  const Camera& CameraOf(const Sight& sight,
                         const std::vector<Camera>& cameras) const {
    return cameras[geometries_[sight.image].camera];
  }

  // No error counts more than the largest coordinate of a pixel, and that of a
  // point that is not in front of its camera as much.
  template <typename PlaceOf>
  double MedianError(const std::vector<Camera>& cameras,
                     const std::vector<RigidTransform>& poses,
                     const PlaceOf& place_of) const {
    std::vector<double> errors;
    for (size_t k = 0; k < tracks_.size(); ++k) {
      const std::optional<Vector3d> place = place_of(k);
      for (const Sight& sight : tracks_[k]) {
        const auto pixel = place ? ProjectPoint(CameraOf(sight, cameras),
                                                poses[sight.image] * *place)
                                 : std::nullopt;
        const double error = pixel ? (*pixel - sight.pixel).norm() : kInfinity;
        errors.push_back(std::fmin(error, largest_px_));
      }
    }
    return errors.empty() ? 0 : LowerMedian(std::move(errors));
  }

  const Model& model_;
  const std::vector<ImageGeometry> geometries_;
  // Whether each frame is one image, so that its pose can be read otherwise.
  bool has_own_poses_ = true;
  std::vector<std::vector<Sight>> tracks_;
  std::set<int32_t> images_;  // that see them
  double largest_px_ = 0;     // coordinate of a pixel
  // Of the points, in the model as it stands; empty for matches.
  std::vector<std::optional<Vector3d>> places_;
};

}  // namespace
}  // namespace krot::internal

namespace krot {

using namespace internal;

bool Conventions::HasOtherPoses() const {
  return has_w_last || is_world_from_cam || has_centers || is_left_handed ||
         !cam_from_file_axes.isIdentity();
}

std::optional<Conventions> FindConventions(const Model& model,
                                           const Database* database,
                                           const Context& context) {
  return ConventionSearch(model, database).Run(context);
}

Model ConvertModel(const Model& model, const Conventions& from,
                   const Context& context) {
  Model converted = model;
  for (Camera& camera : converted.cameras) camera = ConvertCamera(camera, from);
  if (from.HasOtherPoses()) {
    const std::vector<ImageGeometry> geometries = ImageGeometries(model);
    for (size_t n = 0; n < geometries.size(); ++n) {
      if (!geometries[n].has_pose) continue;
      Pose& pose = converted.frames[geometries[n].frame].rig_from_world;
      pose = ToPose(ConvertPose(pose, from));
      converted.images[n].cam_from_world = pose;
    }
  }
  const std::vector<ImageGeometry> geometries = ImageGeometries(converted);
  const std::vector<int32_t> image_of = ImagesOfElements(converted);
  for (Point3D& point : converted.points3D) {
    if (from.is_left_handed) point.xyz = kMirror * point.xyz;
    if (!from.has_wrong_points) continue;
    NearestPoint nearest;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const ImageGeometry& geometry = geometries[image_of[e]];
      if (!geometry.has_pose) continue;
      const auto bearing = PixelBearing(converted.cameras[geometry.camera],
                                        PixelOf(converted, image_of[e], e));
      if (bearing) AddBearing(geometry.cam_from_world, *bearing, &nearest);
    }
    point.xyz = nearest.Solve().value_or(point.xyz);
  }
  UpdatePointErrors(PixelErrors(converted, context.num_threads), &converted);
  return converted;
}

}  // namespace krot
