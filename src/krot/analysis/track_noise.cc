#include "krot/analysis/noise.h"

#include <algorithm>
#include <optional>
#include <set>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/geometry/transform.h"
#include "krot/model/rigs.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;

ObservationNoise NotTested(double w) {
  ObservationNoise noise;
  noise.w = w;
  return noise;
}

// Three columns that are orthonormal and orthogonal to the unit vector X.
Eigen::Matrix<double, 4, 3> TangentBasis(const Vector4d& X) {
  // Householder: I - 2 v v' / v'v takes X to an axis.
  Vector4d v = X;
  v[3] += X[3] < 0 ? -1 : 1;
  const Eigen::Matrix4d reflection =
      Eigen::Matrix4d::Identity() - 2 / v.squaredNorm() * v * v.transpose();
  return reflection.leftCols<3>();
}

}  // namespace

// Relative to the median distance of the cameras from the median of their
// centres. Points that hold cameras together are as near as rounding allows,
// 1e-11 and less; a part of a real model may be as small as 1e-7 of it.
double LeastDistance(const std::vector<ImageGeometry>& geometries) {
  std::vector<Vector3d> centres;
  for (const ImageGeometry& geometry : geometries) {
    if (geometry.has_pose) centres.push_back(Center(geometry.cam_from_world));
  }
  return centres.empty() ? 0
                         : 1e-9 * MedianDistance(centres, MedianPlace(centres));
}

std::optional<DifferentiatedError> DifferentiateError(const Camera& camera,
                                                      const Point2D& pixel,
                                                      const Vector3d& x_cam) {
  const auto E = RowAtProjection(camera, {pixel.x, pixel.y}, x_cam);
  if (!E) return std::nullopt;
  const double depth = E->row(0).dot(x_cam);
  const Vector2d error = E->bottomRows<2>() * x_cam / depth;
  return DifferentiatedError{error,
                             (E->bottomRows<2>() - error * E->row(0)) / depth};
}

// Fits a point in homogeneous coordinates, so that one at infinity, or beyond
// by the noise of its rays, is like any other. The origin is the first camera,
// the unit its distance from the farthest one.
class TrackNoise::Track {
 public:
  Track(TrackNoise* all, int64_t k) : all_(*all), k_(k) {
    const Point3D& point = all_.model_.points3D[k];
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (all_.takes_part_[e]) elements_.push_back(e);
    }
  }

  void Run() {
    if (elements_.size() < 2) {
      for (const uint64_t e : elements_)
        all_.observations_[e] = NotTested(kNaN);
      return;
    }
    Begin();
    Minimize();
    DropInCamera();
    Describe();
  }

 private:
  const View& ViewOf(uint64_t e) const {
    return all_.views_[all_.image_of_[e]];
  }

  std::optional<Row> RowAt(uint64_t e, const Vector4d& X,
                           const Eigen::Matrix<double, 4, 3>& basis) const {
    const View& view = ViewOf(e);
    const Vector3d c = (view.center - origin_) / unit_;
    const Vector3d x_cam =
        view.cam_from_world_rotation * (X.head<3>() - X[3] * c);
    const Point2D& pixel =
        view.image->points2D[all_.model_.track_elements[e].point2D_idx];
    const auto projected = DifferentiateError(*view.camera, pixel, x_cam);
    if (!projected) return std::nullopt;
    Row row;
    row.error = projected->error;
    const Eigen::Matrix<double, 2, 3> by_world =
        projected->by_cam * view.cam_from_world_rotation;
    row.J = by_world * (basis.topRows<3>() - c * basis.row(3));
    if (!all_.relative_sigmas_.empty()) {
      row.error /= all_.relative_sigmas_[e];
      row.J /= all_.relative_sigmas_[e];
    }
    if (!row.J.allFinite() || !row.error.allFinite()) return std::nullopt;
    return row;
  }

  void Begin() {
    const Point3D& point = all_.model_.points3D[k_];
    origin_ = ViewOf(elements_[0]).center;
    unit_ = 0;
    for (const uint64_t e : elements_) {
      unit_ = std::max(unit_, (ViewOf(e).center - origin_).norm());
    }
    if (!(unit_ > 0)) unit_ = (point.xyz - origin_).norm();
    if (!(unit_ > 0)) unit_ = 1;
    X_ << (point.xyz - origin_) / unit_, 1;
    X_.normalize();
    const auto basis = TangentBasis(X_);
    // Observations that do not see the point have no part in the fit.
    size_t num = 0;
    for (const uint64_t e : elements_) {
      const auto row = RowAt(e, X_, basis);
      if (row) {
        rows_.push_back(*row);
        elements_[num++] = e;
      } else {
        all_.observations_[e] = NotTested(kInfinity);
      }
    }
    elements_.resize(num);
    cost_ = CostOf(rows_);
  }

  static double CostOf(const std::vector<Row>& rows) {
    double sum = 0;
    for (const Row& row : rows) sum += row.error.squaredNorm();
    return sum;
  }

  // Levenberg-Marquardt.
  void Minimize() {
    double damping = 0;
    std::vector<Row> trial(rows_.size());
    for (int i = 0; i < 50; ++i) {
      Matrix3d H = Matrix3d::Zero();
      Vector3d g = Vector3d::Zero();
      for (const Row& row : rows_) {
        H.noalias() += row.J.transpose() * row.J;
        g.noalias() += row.J.transpose() * row.error;
      }
      const double scale = H.trace();
      if (!(scale > 0)) return;
      H.diagonal().array() += (damping + kNoDirection) * scale;
      const Vector3d step = -H.ldlt().solve(g);
      // A step must promise more than this share of the sum of squares.
      if (!(-g.dot(step) > 1e-8 * cost_)) return;
      Vector4d X = X_ + TangentBasis(X_) * step;
      X.normalize();
      const auto basis = TangentBasis(X);
      bool is_seen = true;
      for (size_t n = 0; n < rows_.size() && is_seen; ++n) {
        const auto row = RowAt(elements_[n], X, basis);
        is_seen = row.has_value();
        if (is_seen) trial[n] = *row;
      }
      const double cost = is_seen ? CostOf(trial) : kInfinity;
      if (cost < cost_) {
        X_ = X;
        rows_.swap(trial);
        cost_ = cost;
        damping = damping < 1e-6 ? 0 : damping / 10;
      } else {
        damping = std::max(1e-6, 10 * damping);
        if (damping > 1e3) return;
      }
    }
  }

  // Any observation fits a point in its camera, so it says nothing. Two cameras
  // that hold the same point can hardly move apart. Other points of such two
  // are not in the camera, though their fit may be.
  void DropInCamera() {
    const Vector3d& in_model = all_.model_.points3D[k_].xyz;
    size_t num = 0;
    for (size_t n = 0; n < rows_.size(); ++n) {
      const uint64_t e = elements_[n];
      const Vector3d away =
          X_.head<3>() * unit_ + X_[3] * (origin_ - ViewOf(e).center);
      const bool is_fit_in = away.norm() < X_[3] * all_.least_distance_;
      if (is_fit_in &&
          (in_model - ViewOf(e).center).norm() < all_.least_distance_) {
        all_.observations_[e] = NotTested(kInfinity);
        continue;
      }
      is_in_camera_ = is_in_camera_ || is_fit_in;
      elements_[num] = e;
      rows_[num++] = rows_[n];
    }
    elements_.resize(num);
    rows_.resize(num);
  }

  // R_ii, and the standardised errors that it gives.
  void Describe() {
    Matrix3d H = Matrix3d::Zero();
    for (const Row& row : rows_) H.noalias() += row.J.transpose() * row.J;
    const Matrix3d root = RootOfInverse(H);
    for (size_t n = 0; n < rows_.size(); ++n) {
      const uint64_t e = elements_[n];
      const Eigen::Matrix<double, 2, 3> B = rows_[n].J * root;
      const Eigen::Matrix2d R = Eigen::Matrix2d::Identity() - B * B.transpose();
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> of_R;
      of_R.computeDirect(R);
      ObservationNoise& noise = all_.observations_[e];
      noise = {};
      noise.error_px = rows_[n].error;
      if (!all_.relative_sigmas_.empty()) {
        noise.relative_sigma = all_.relative_sigmas_[e];
        noise.error_px *= noise.relative_sigma;
      }
      double sum = 0;
      for (int j = 0; j < 2; ++j) {
        const double r = std::clamp(of_R.eigenvalues()[j], 0.0, 1.0);
        noise.redundancy[j] = r;
        if (r < kControlled) continue;
        ++noise.num_controlled;
        const double along = of_R.eigenvectors().col(j).dot(rows_[n].error);
        sum += along * along / r;
      }
      all_.squared_errors_[e] = sum;
    }
    all_.is_in_camera_[k_] = is_in_camera_;
    all_.points_[k_] << X_.head<3>() * unit_ + X_[3] * origin_, X_[3];
  }

  TrackNoise& all_;
  const int64_t k_;
  std::vector<uint64_t> elements_;
  std::vector<Row> rows_;
  Vector3d origin_ = Vector3d::Zero();
  double unit_ = 1;
  bool is_in_camera_ = false;  // in one that still sees it
  Vector4d X_ = Vector4d::Zero();
  double cost_ = 0;
};

TrackNoise::TrackNoise(const Model& model,
                       const std::vector<double>& relative_sigmas)
    : model_(model),
      relative_sigmas_(relative_sigmas),
      image_of_(ImagesOfElements(model)),
      point_of_(PointsOfElements(model)),
      takes_part_(model.track_elements.size(), 0),
      observations_(model.track_elements.size()),
      squared_errors_(model.track_elements.size(), 0),
      points_(model.points3D.size(), Vector4d::Zero()),
      is_in_camera_(model.points3D.size(), 0) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  for (size_t n = 0; n < geometries.size(); ++n) {
    View view;
    if (geometries[n].has_pose) {
      view.camera = &model.cameras[geometries[n].camera];
      view.image = &model.images[n];
      view.cam_from_world_rotation = geometries[n].cam_from_world.rotation;
      view.center = Center(geometries[n].cam_from_world);
    }
    views_.push_back(view);
  }
  least_distance_ = LeastDistance(geometries);
  for (size_t e = 0; e < model.track_elements.size(); ++e) {
    takes_part_[e] = views_[image_of_[e]].camera != nullptr;
    observations_[e] = NotTested(kNaN);
  }
}

void TrackNoise::Fit(int64_t k) { Track(this, k).Run(); }

void TrackNoise::Remove(uint64_t e) {
  takes_part_[e] = 0;
  observations_[e] = NotTested(kNaN);
}

Vector2d TrackNoise::ErrorOf(uint64_t e) const {
  const Vector4d& X = points_[point_of_[e]];
  const View& view = views_[image_of_[e]];
  const Point2D& pixel =
      view.image->points2D[model_.track_elements[e].point2D_idx];
  return ProjectionError(
             *view.camera, {pixel.x, pixel.y},
             view.cam_from_world_rotation * (X.head<3>() - X[3] * view.center))
      .value_or(Vector2d::Constant(kNaN));
}

std::vector<int32_t> PointsOfElements(const Model& model) {
  std::vector<int32_t> point_of(model.track_elements.size());
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const Point3D& point = model.points3D[k];
    std::fill(point_of.begin() + static_cast<int64_t>(point.track_begin),
              point_of.begin() + static_cast<int64_t>(point.track_end),
              static_cast<int32_t>(k));
  }
  return point_of;
}

std::vector<char> HaveBarePoses(const Model& model,
                                const std::vector<ImageGeometry>& geometries) {
  std::vector<char> is_held(model.frames.size(), 0);
  for (size_t n = 0; n < geometries.size(); ++n) {
    if (geometries[n].has_pose && !model.images[n].points2D.empty())
      is_held[geometries[n].frame] = 1;
  }
  std::vector<char> is_bare;
  for (const ImageGeometry& geometry : geometries) {
    is_bare.push_back(geometry.has_pose && is_held[geometry.frame] == 0);
  }
  return is_bare;
}

bool HasRedundancy(const Model& model, const ModelNoise& noise) {
  const std::vector<ImageGeometry> geometries = ImageGeometries(model);
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  std::set<int32_t> frames;
  int64_t redundancy = 7;
  for (const Point3D& point : model.points3D) {
    bool is_seen = false;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (noise.observations[e].num_controlled == 0) continue;
      frames.insert(geometries[image_of[e]].frame);
      redundancy += 2;
      is_seen = true;
    }
    if (is_seen) redundancy -= 3;
  }
  return noise.sigma_px && redundancy > 6 * static_cast<int64_t>(frames.size());
}

Vector3d TrackNoise::Point(int64_t k) const {
  const Vector4d& X = points_[k];
  const Vector3d xyz = X.head<3>() / X[3];
  return X[3] > 0 && xyz.allFinite() && is_in_camera_[k] == 0
             ? xyz
             : model_.points3D[k].xyz;
}

}  // namespace krot::internal
