#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "krot/analysis/noise.h"
#include "krot/analysis/track_sample.h"
#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/check.h"
#include "krot/geometry.h"
#include "krot/model.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Matrix23 = Eigen::Matrix<double, 2, 3>;

constexpr size_t kFewestSights = 10;  // of an image that is asked
constexpr int64_t kMostSights = 100;  // of an image, evenly spread
// Of the photo's size: others are not so much smaller, and a principal point is
// farther from the edges.
constexpr double kLeastShare = 0.1;
constexpr int kMostInVain = 100;  // images whose map explains no others

const Matrix23 kAsRead = Matrix23::Identity();

struct Sight {
  const Camera* camera;
  Vector3d x_cam;
  Vector2d projected, pixel;
};
using Sights = std::vector<Sight>;

// By image; none of images with too few.
std::vector<Sights> SightsOfImages(
    const Model& model, const std::vector<ImageGeometry>& geometries) {
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  std::vector<int64_t> num(model.images.size(), 0);
  for (const int32_t n : image_of) ++num[n];
  std::vector<int64_t> passed(model.images.size(), 0);
  std::vector<Sights> sights(model.images.size());
  for (const Point3D& point : model.points3D) {
    if (point.track_end - point.track_begin < 2) continue;  // says nothing
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const int32_t n = image_of[e];
      const ImageGeometry& geometry = geometries[n];
      if (!geometry.has_pose || passed[n]++ % (num[n] / kMostSights + 1) != 0) {
        continue;
      }
      const Camera& camera = model.cameras[geometry.camera];
      const Vector3d x_cam = geometry.cam_from_world * point.xyz;
      const auto projected = ProjectPoint(camera, x_cam);
      const Point2D& pixel =
          model.images[n].points2D[model.track_elements[e].point2D_idx];
      if (!projected || !projected->allFinite() ||
          !std::isfinite(pixel.x + pixel.y)) {
        continue;
      }
      sights[n].push_back({&camera, x_cam, *projected, {pixel.x, pixel.y}});
    }
  }
  for (Sights& own : sights) {
    if (own.size() < kFewestSights) own.clear();
  }
  return sights;
}

Vector2d ErrorAt(const Matrix23& map, const Sight& sight) {
  return map * sight.projected.homogeneous() - sight.pixel;
}

// In pixels of the camera.
double ErrorOf(const Matrix23& map, const Sight& sight) {
  const Vector2d scale = map.leftCols<2>().rowwise().norm();
  return ErrorAt(map, sight).cwiseQuotient(scale).norm();
}

template <typename ErrorOfSight>
double MedianError(const Sights& sights, const ErrorOfSight& error_of) {
  std::vector<double> errors;
  errors.reserve(sights.size());
  for (const Sight& sight : sights) {
    const double error = error_of(sight);
    errors.push_back(std::isnan(error) ? kInfinity : error);
  }
  return LowerMedian(std::move(errors));
}

double MedianError(const Sights& sights, const Matrix23& map) {
  return MedianError(sights,
                     [&](const Sight& sight) { return ErrorOf(map, sight); });
}

// Up to 6 x 6, without allocation.
using SmallMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6>;
using SmallVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 6, 1>;

// The typical distance of a pixel from the origin, relative to the projected.
double SizeOf(const Sights& sights) {
  std::vector<double> seen, projected;
  for (const Sight& sight : sights) {
    seen.push_back(sight.pixel.norm());
    projected.push_back(sight.projected.norm());
  }
  return LowerMedian(std::move(seen)) / LowerMedian(std::move(projected));
}

using Rows = std::pair<SmallMatrix, Vector2d>;

// The x = x0 + P y with the least sum of distances |J x - r|, where rows_of
// gives (J, r) of a sight: least squares with weights anew.
template <typename RowsOf>
SmallVector LeastDistances(const Sights& sights, const SmallVector& x0,
                           const SmallMatrix& P, const RowsOf& rows_of) {
  const double least = 0.1 * SizeOf(sights);
  SmallVector x = x0;
  for (int step = 0; step < 20; ++step) {
    SmallMatrix H = SmallMatrix::Zero(P.cols(), P.cols());
    SmallVector g = SmallVector::Zero(P.cols());
    for (const Sight& sight : sights) {
      const auto [J, r] = rows_of(sight);
      const double weight = 1 / std::max((J * x - r).norm(), least);
      const SmallMatrix A = J * P;
      H += weight * A.transpose() * A;
      g += weight * A.transpose() * (r - J * x0);
    }
    x = x0 + P * H.ldlt().solve(g);
  }
  return x;
}

// The simplest map along the photo's axes that leaves hardly more than the most
// general one: a shift; a scale, or one for each axis; or both.
Matrix23 FitMap(const Sights& sights) {
  Matrix2d axes = Matrix2d::Identity();
  const auto fit = [&](const SmallVector& x0, const SmallMatrix& P) {
    const SmallVector x =
        LeastDistances(sights, x0, P, [&](const Sight& sight) {
          const Vector2d turned = axes * sight.projected;
          SmallMatrix J = SmallMatrix::Zero(2, 4);
          J.leftCols<2>() = turned.asDiagonal();
          J.rightCols<2>() = Matrix2d::Identity();
          return Rows(J, sight.pixel);
        });
    Matrix23 map;
    map << x.head<2>().asDiagonal() * axes, x.tail<2>();
    return map;
  };
  const SmallVector zero = SmallVector::Zero(4);
  const SmallMatrix all = SmallMatrix::Identity(4, 4);
  Matrix23 general = fit(zero, all);
  axes << 0, 1, 1, 0;
  const Matrix23 exchanged = fit(zero, all);
  if (MedianError(sights, exchanged) < MedianError(sights, general)) {
    general = exchanged;
  }
  axes = general.leftCols<2>().array().sign();
  const Vector4d same(1, 1, 0, 0);
  SmallMatrix scale_and_shift(4, 3);
  scale_and_shift << same, all.rightCols<2>();
  const double most = 1.1 * MedianError(sights, general);
  for (const Matrix23& map :
       {fit(same, all.rightCols<2>()), fit(zero, same),
        fit(zero, all.leftCols<2>()), fit(zero, scale_and_shift)}) {
    if (MedianError(sights, map) <= most) return map;
  }
  return general;
}

// Whether the map explains the pixels better than a turn and a move of the
// cameras, all alike in their own axes, by this factor.
bool BeatsAnyMove(const Matrix23& map, Sights sights, double factor) {
  const double mapped = MedianError(
      sights, [&](const Sight& sight) { return ErrorAt(map, sight).norm(); });
  for (int step = 0; step < 5; ++step) {
    const SmallVector move = LeastDistances(
        sights, SmallVector::Zero(6), SmallMatrix::Identity(6, 6),
        [](const Sight& sight) {
          // By x_cam, for a step at which pixels hardly bend.
          const double h = 1e-5 * sight.x_cam.norm();
          SmallMatrix by_point = SmallMatrix::Zero(2, 3);
          for (const int i : {0, 1, 2}) {
            const auto moved = ProjectPoint(
                *sight.camera, sight.x_cam + h * Vector3d::Unit(i));
            if (moved) by_point.col(i) = (*moved - sight.projected) / h;
          }
          SmallMatrix J(2, 6);
          J << -by_point * CrossMatrix(sight.x_cam), by_point;
          return Rows(J, sight.pixel - sight.projected);
        });
    const Vector3d axis = move.head<3>().stableNormalized();
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(move.head<3>().norm(), axis).toRotationMatrix();
    for (Sight& sight : sights) {
      sight.x_cam = turn * sight.x_cam + move.tail<3>();
      const auto projected = ProjectPoint(*sight.camera, sight.x_cam);
      if (projected) sight.projected = *projected;
    }
  }
  const double moved = MedianError(sights, [](const Sight& sight) {
    return ErrorAt(kAsRead, sight).norm();
  });
  return factor * mapped < moved;
}

// The cameras of the images as the map has them. Empty if an image of theirs
// fits as read or most fit in no way, or if no camera has such pixels: with
// other axes, normalised, from the middle of the photo, or with two scales for
// one focal length.
std::vector<Camera> MappedCameras(const Model& model,
                                  const std::vector<ImageGeometry>& geometries,
                                  const std::vector<double>& errors,
                                  const PixelMap& map) {
  const Vector2d scale = map.image_from_camera.leftCols<2>().diagonal();
  if (!(scale.minCoeff() > kLeastShare)) return {};
  std::set<int32_t> cameras;
  for (const int32_t n : map.images) cameras.insert(geometries[n].camera);
  size_t num_others = 0;
  for (size_t n = 0; n < errors.size(); ++n) {
    const bool is_mapped = std::binary_search(
        map.images.begin(), map.images.end(), static_cast<int32_t>(n));
    if (is_mapped || errors[n] == 0 ||
        cameras.count(geometries[n].camera) == 0) {
      continue;
    }
    if (errors[n] <= kFilteredPx) return {};
    ++num_others;
  }
  if (num_others > map.images.size()) return {};

  const bool is_resized = map.image_from_camera.col(2).isZero();
  std::vector<Camera> mapped;
  for (const int32_t c : cameras) {
    Camera& camera = mapped.emplace_back(model.cameras[c]);
    const CameraModelInfo& info = *FindCameraModel(camera.model_id);
    const int center = info.num_focal_lengths();
    if (!info.has_image_plane || (center == 1 && scale[0] != scale[1])) {
      return {};
    }
    const std::array<uint64_t*, 2> size = {&camera.width, &camera.height};
    for (const int i : {0, 1}) {
      if (is_resized) {
        *size[i] = std::llround(scale[i] * static_cast<double>(*size[i]));
      }
      if (i < center) camera.params[i] *= scale[i];
      double& principal = camera.params[center + i];
      principal = scale[i] * principal + map.image_from_camera(i, 2);
      const double share = principal / static_cast<double>(*size[i]);
      if (!(std::min(share, 1 - share) > kLeastShare)) return {};
    }
  }
  return mapped;
}

class PixelMapSearch {
 public:
  // Keeps references.
  PixelMapSearch(const Model& model,
                 const std::vector<ImageGeometry>& geometries)
      : model_(model),
        geometries_(geometries),
        sights_(SightsOfImages(model, geometries)),
        errors_(sights_.size(), 0),
        own_errors_(sights_.size(), -1) {
    std::vector<double> sound;
    for (size_t n = 0; n < sights_.size(); ++n) {
      if (sights_[n].empty()) continue;
      ++num_images_;
      errors_[n] = MedianError(sights_[n], kAsRead);
      if (errors_[n] <= kFilteredPx) sound.push_back(errors_[n]);
      if (errors_[n] > kFilteredPx) asked_.push_back(static_cast<int32_t>(n));
    }
    if (!sound.empty()) sound_px_ = LowerMedian(std::move(sound));
  }

  PixelMaps Run(const Context& context) {
    int num_in_vain = 0;
    while (!asked_.empty() && num_in_vain < kMostInVain &&
           !context.IsCancelled()) {
      PixelMap map = MapOf(asked_.front());
      if (!Counts(map)) {
        ++num_in_vain;
        asked_.erase(asked_.begin());
      } else {
        Take(std::move(map));
      }
    }
    if (found_.pixel_maps.empty()) return {};
    found_.median_error_as_read_px = LowerMedian(std::move(before_));
    found_.median_error_px = LowerMedian(std::move(after_));
    return {found_, MayBeOther(found_.pixel_maps.front())};
  }

 private:
  // The map of an image and of all others that it explains.
  PixelMap MapOf(int32_t image) {
    PixelMap map;
    map.images = {image};
    for (size_t num = 0; map.images.size() > num;) {
      num = map.images.size();
      map.image_from_camera = FitMap(SightsOf(map));
      map.images = ExplainedBy(map.image_from_camera);
    }
    return map;
  }

  // The asked images that a map explains, hardly less well than their own map.
  std::vector<int32_t> ExplainedBy(const Matrix23& map) {
    std::vector<int32_t> images;
    for (const int32_t n : asked_) {
      const double mapped = MedianError(sights_[n], map);
      if (mapped > std::min(kFilteredPx, errors_[n] / 4)) continue;
      double& own = own_errors_[n];
      if (own < 0) own = MedianError(sights_[n], FitMap(sights_[n]));
      if (mapped <= std::max(0.1, 2 * own)) images.push_back(n);
    }
    return images;
  }

  // One or two images may have the same pose error by chance, or hardly any
  // sound pixel.
  bool Counts(const PixelMap& map) const {
    if (map.images.empty()) return false;
    const bool is_few = map.images.size() < 3;
    const Sights sights = SightsOf(map);
    return (!is_few ||
            MedianError(sights, map.image_from_camera) <= 2 * sound_px_) &&
           BeatsAnyMove(map.image_from_camera, sights, is_few ? 2 : 1);
  }

  void Take(PixelMap map) {
    for (const Sight& sight : SightsOf(map)) {
      before_.push_back(ErrorOf(kAsRead, sight));
      after_.push_back(ErrorOf(map.image_from_camera, sight));
    }
    const std::vector<int32_t> asked = std::move(asked_);
    asked_.clear();
    std::set_difference(asked.begin(), asked.end(), map.images.begin(),
                        map.images.end(), std::back_inserter(asked_));
    map.cameras = MappedCameras(model_, geometries_, errors_, map);
    for (const int32_t n : map.images) {
      map.image_names.push_back(model_.images[n].name);
    }
    found_.pixel_maps.push_back(std::move(map));
  }

  bool MayBeOther(const PixelMap& map) const {
    const Matrix2d change = (map.image_from_camera - kAsRead).leftCols<2>();
    const bool is_of_all_photos =
        map.images.size() == num_images_ && !change.isZero(0.25);
    return is_of_all_photos ||
           std::any_of(map.images.begin(), map.images.end(),
                       [&](int32_t n) { return geometries_[n].sensor >= 0; });
  }

  Sights SightsOf(const PixelMap& map) const {
    Sights joined;
    for (const int32_t n : map.images) {
      joined.insert(joined.end(), sights_[n].begin(), sights_[n].end());
    }
    return joined;
  }

  const Model& model_;
  const std::vector<ImageGeometry>& geometries_;
  const std::vector<Sights> sights_;  // by image
  std::vector<double> errors_;        // as read; 0 without sights
  std::vector<double> own_errors_;    // by the image's own map; -1: unknown
  double sound_px_ = 0;               // of the images that fit as read
  size_t num_images_ = 0;             // with sights
  std::vector<int32_t> asked_;
  Conventions found_;
  std::vector<double> before_, after_;  // errors in all that is mapped
};

}  // namespace

PixelMaps FindPixelMaps(const Model& model,
                        const std::vector<ImageGeometry>& geometries,
                        const Context& context) {
  return PixelMapSearch(model, geometries).Run(context);
}

}  // namespace krot::internal
