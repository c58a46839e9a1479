#include "krot/analysis/camera_check.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/geometry/transform.h"
#include "krot/linear/blocks.h"

namespace krot::internal {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix23 = Eigen::Matrix<double, 2, 3>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

// Of a difference quotient, relative to parameters above 1: its square and the
// rounding of pixels over it are both far below a pixel.
constexpr double kParamStep = 1e-6;

std::vector<std::string_view> ParamNames(const Camera& camera) {
  std::vector<std::string_view> names;
  std::string_view rest = FindCameraModel(camera.model_id)->param_names;
  while (!rest.empty()) {
    const size_t comma = rest.find(", ");
    names.push_back(rest.substr(0, comma));
    rest = comma == std::string_view::npos ? "" : rest.substr(comma + 2);
  }
  return names;
}

CameraFault FaultOfParam(std::string_view name) {
  if (name == "f" || name == "fx" || name == "fy") {
    return CameraFault::kFocalLength;
  }
  return name == "cx" || name == "cy" ? CameraFault::kPrincipalPoint
                                      : CameraFault::kDistortion;
}

}  // namespace

PoseRows::PoseRows(const Model& model, const ModelNoise& noise)
    : model_(model),
      noise_(noise),
      geometries_(ImageGeometries(model)),
      image_of_(ImagesOfElements(model)),
      nearest_(model.images.size(), 0) {
  std::vector<std::vector<double>> distances(model.images.size());
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const Point3D& point = model.points3D[k];
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      const int32_t n = image_of_[e];
      if (!geometries_[n].has_pose) continue;
      distances[n].push_back(
          (geometries_[n].cam_from_world * noise.points[k]).norm());
    }
  }
  for (size_t n = 0; n < distances.size(); ++n) {
    if (distances[n].empty()) continue;
    // A nearer point would drown all others in rounding.
    nearest_[n] = 1e-6 * Median(std::move(distances[n]));
  }
}

std::vector<PoseRow> PoseRows::Of(size_t k) const {
  const Point3D& point = model_.points3D[k];
  std::vector<PoseRow> rows;
  for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
    if (noise_.observations[e].num_controlled == 0) continue;
    const int32_t n = image_of_[e];
    const RigidTransform& pose = geometries_[n].cam_from_world;
    const Camera& camera = model_.cameras[geometries_[n].camera];
    const Point2D& pixel =
        model_.images[n].points2D[model_.track_elements[e].point2D_idx];
    PoseRow row;
    row.x_cam = pose * noise_.points[k];
    if (!(row.x_cam.norm() > nearest_[n])) continue;
    const auto projected = DifferentiateError(camera, pixel, row.x_cam);
    if (!projected) continue;
    row.element = e;
    row.image = n;
    row.error = noise_.observations[e].error_px;
    const Matrix23& by_cam = projected->by_cam;
    row.F << -by_cam * CrossMatrix(row.x_cam), -by_cam * pose.rotation;
    if (row.F.allFinite()) rows.push_back(row);
  }
  if (rows.size() < 2) rows.clear();
  return rows;
}

Matrix3d PoseRows::RootOf(const std::vector<PoseRow>& rows) {
  Matrix3d H = Matrix3d::Zero();
  for (const PoseRow& row : rows) {
    H.noalias() += row.F.rightCols<3>().transpose() * row.F.rightCols<3>();
  }
  return RootOfInverse(H);
}

SharedColumns::SharedColumns(const Model& model,
                             const std::vector<ImageGeometry>& geometries,
                             const std::vector<ImageSums>& sums)
    : model_(model), geometries_(geometries) {
  AddLenses();
  AddPlaces();
  Number();
  for (size_t n = 0; n < sums.size(); ++n) {
    if (!geometries[n].has_pose) continue;
    const auto add = [&](int32_t g) {
      ++groups_[g].num_images;
      groups_[g].num_directions += sums[n].num_directions;
      groups_[g].square += sums[n].square;
    };
    for (const int32_t g : groups_of_camera_[geometries[n].camera]) add(g);
    if (place_of_image_[n] >= 0) add(place_of_image_[n]);
  }
}

void SharedColumns::Keep(const std::vector<char>& is_kept) {
  for (size_t n = 0; n < groups_.size(); ++n) {
    if (!is_kept[n]) groups_[n].size = 0;
  }
  Number();
}

void SharedColumns::AddLenses() {
  groups_of_camera_.resize(model_.cameras.size());
  for (size_t c = 0; c < model_.cameras.size(); ++c) {
    const Camera& camera = model_.cameras[c];
    if (!FindCameraModel(camera.model_id)->has_image_plane) continue;
    const std::vector<std::string_view> names = ParamNames(camera);
    for (const CameraFault fault :
         {CameraFault::kFocalLength, CameraFault::kPrincipalPoint,
          CameraFault::kDistortion}) {
      SharedGroup group;
      group.camera = static_cast<int32_t>(c);
      group.fault = fault;
      for (size_t i = 0; i < names.size(); ++i) {
        if (FaultOfParam(names[i]) == fault) {
          group.params.push_back(static_cast<int>(i));
        }
      }
      group.size = static_cast<Index>(group.params.size());
      if (group.size == 0) continue;
      groups_of_camera_[c].push_back(static_cast<int32_t>(groups_.size()));
      groups_.push_back(group);
    }
  }
}

void SharedColumns::AddPlaces() {
  std::map<std::pair<int32_t, int32_t>, int32_t> group_of;
  for (const ImageGeometry& geometry : geometries_) {
    place_of_image_.push_back(-1);
    if (!geometry.has_pose || geometry.sensor < 0) continue;
    const auto [entry, is_new] = group_of.try_emplace(
        {geometry.rig, geometry.sensor}, static_cast<int32_t>(groups_.size()));
    place_of_image_.back() = entry->second;
    if (!is_new) continue;
    SharedGroup& group = groups_.emplace_back();
    group.camera = geometry.camera;
    group.rig = geometry.rig;
    group.fault = CameraFault::kPlaceInRig;
    group.size = 6;
  }
}

void SharedColumns::Number() {
  num_columns_ = 0;
  for (SharedGroup& group : groups_) {
    group.begin = num_columns_;
    num_columns_ += group.size;
  }
}

std::vector<ByGroup> SharedColumns::ByGroups(const PoseRow& row) const {
  const ImageGeometry& geometry = geometries_[row.image];
  std::vector<ByGroup> all;
  Camera camera = model_.cameras[geometry.camera];
  for (const int32_t n : groups_of_camera_[geometry.camera]) {
    const SharedGroup& group = groups_[n];
    if (group.size == 0) continue;
    ByGroup& by = all.emplace_back();
    by.group = n;
    by.C.setZero(2, group.size);
    for (Index i = 0; i < group.size; ++i) {
      double& param = camera.params[group.params[i]];
      const double value = param;
      const double step = kParamStep * std::max(1.0, std::abs(value));
      param = value + step;
      const auto above = ProjectPoint(camera, row.x_cam);
      param = value - step;
      const auto below = ProjectPoint(camera, row.x_cam);
      param = value;
      if (above && below) by.C.col(i) = (*above - *below) / (2 * step);
    }
  }
  const int32_t place = place_of_image_[row.image];
  if (place >= 0 && groups_[place].size > 0) {
    ByGroup& by = all.emplace_back();
    by.group = place;
    by.C.resize(2, 6);
    by.C << row.F.leftCols<3>(),
        row.F.rightCols<3>() * geometry.rig_from_world.rotation.transpose();
  }
  return all;
}

namespace {

void Add(const PoseRow& row, const Matrix2d& R, ImageSums* sums) {
  Eigen::SelfAdjointEigenSolver<Matrix2d> of_R;
  of_R.computeDirect(R);
  for (int j = 0; j < 2; ++j) {
    const double r = of_R.eigenvalues()[j];
    if (r < kControlled) continue;
    const Vector2d direction = of_R.eigenvectors().col(j);
    const Vector6 f = row.F.transpose() * direction;
    const double along = direction.dot(row.error);
    sums->M.noalias() += r * f * f.transpose();
    sums->g.noalias() += along * f;
    sums->square += along * along / r;
    ++sums->num_directions;
  }
}

// 1 / sqrt of the smallest eigenvalue of A - B C^-1 B'; infinite if nothing
// holds.
double LargestSpread(const Matrix3d& A, const Matrix3d& B, const Matrix3d& C) {
  const Matrix3d S = A - B * C.ldlt().solve(B.transpose());
  if (!S.allFinite()) return kInfinity;
  const Vector3d values =
      Eigen::SelfAdjointEigenSolver<Matrix3d>(S, Eigen::EigenvaluesOnly)
          .eigenvalues();
  const bool is_held = values[0] > kNoDirection * A.trace();
  return is_held ? 1 / std::sqrt(values[0]) : kInfinity;
}

}  // namespace

double ImageSums::CenterSpread() const {
  return LargestSpread(M.bottomRightCorner<3, 3>(), M.bottomLeftCorner<3, 3>(),
                       M.topLeftCorner<3, 3>());
}

double ImageSums::TurnSpread() const {
  return LargestSpread(M.topLeftCorner<3, 3>(), M.topRightCorner<3, 3>(),
                       M.bottomRightCorner<3, 3>());
}

double ImageSums::GainExponent(double sigma_px) const {
  return internal::GainExponent(Gain(), square, num_directions, 6, sigma_px);
}

std::vector<ImageSums> AddUpImages(const Model& model,
                                   const ModelNoise& noise) {
  const PoseRows all(model, noise);
  std::vector<ImageSums> sums(model.images.size());
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const std::vector<PoseRow> rows = all.Of(k);
    const Matrix3d root = PoseRows::RootOf(rows);
    for (const PoseRow& row : rows) {
      const Matrix23 B = row.F.rightCols<3>() * root;
      const Matrix2d R = Matrix2d::Identity() - B * B.transpose();
      Add(row, R, &sums[row.image]);
    }
  }
  for (ImageSums& of_image : sums) {
    of_image.step = DeterminedStep(of_image.M, of_image.g);
  }
  return sums;
}

namespace {

// For smaller lambda the density is nearly even, and a series replaces formulas
// that would lose digits.
constexpr double kFlat = 1e-4;

// The mean of the density lambda exp(-lambda u) / (1 - exp(-lambda)) on [0, 1].
double MeanInDisc(double lambda) {
  return lambda < kFlat ? 0.5 - lambda / 12
                        : 1 / lambda - 1 / std::expm1(lambda);
}

// log(lambda / (1 - exp(-lambda))).
double LogFactorInDisc(double lambda) {
  return lambda < kFlat ? lambda / 2 : std::log(lambda / -std::expm1(-lambda));
}

// The same for the density f exp(-lambda u) / (2 sqrt(u)), whose factor is f.
double LogFactorOnSegment(double lambda) {
  if (lambda < kFlat) return lambda / 3;
  const double root = std::sqrt(lambda);
  return std::log(2 * root / (std::sqrt(kPi) * std::erf(root)));
}

double MeanOnSegment(double lambda) {
  if (lambda < kFlat) return 1.0 / 3 - 4.0 / 45 * lambda;
  return (1 - std::exp(LogFactorOnSegment(lambda) - lambda)) / (2 * lambda);
}

}  // namespace

ErrorsInDisc::ErrorsInDisc(const std::vector<double>& errors_px,
                           const std::vector<double>& errors_of_two_px,
                           double limit_px) {
  const auto add = [&](const std::vector<double>& errors, double weight,
                       int64_t* count) {
    for (const double error : errors) {
      if (!(error <= limit_px) || limit_px == 0) continue;
      ++*count;
      mean_ += weight * error * error / (limit_px * limit_px);
    }
  };
  add(errors_px, 1, &num_in_disc_);
  add(errors_of_two_px, 2, &num_on_segment_);
  if (num() == 0) return;
  mean_ = std::min(MeanAt(0), mean_ / static_cast<double>(num()));
  if (mean_ == MeanAt(0)) return;
  double low = 0;
  double high = 1 / std::max(mean_, std::numeric_limits<double>::min());
  for (double middle = high / 2; low < middle && middle < high;
       middle = low + (high - low) / 2) {
    (MeanAt(middle) > mean_ ? low : high) = middle;
  }
  lambda_ = low;
}

double ErrorsInDisc::MeanAt(double lambda) const {
  return (static_cast<double>(num_in_disc_) * MeanInDisc(lambda) +
          2 * static_cast<double>(num_on_segment_) *
              MeanOnSegment(2 * lambda)) /
         static_cast<double>(num());
}

double ErrorsInDisc::LogFactors(double lambda) const {
  return static_cast<double>(num_in_disc_) * LogFactorInDisc(lambda) +
         static_cast<double>(num_on_segment_) * LogFactorOnSegment(2 * lambda);
}

double ErrorsInDisc::Exponent(double other) const {
  return LogFactors(lambda_) - LogFactors(other) +
         (other - lambda_) * mean_ * static_cast<double>(num());
}

std::vector<ErrorsInDisc> FillDiscs(const Model& model,
                                    const std::vector<double>& errors_px) {
  const std::vector<int32_t> image_of = ImagesOfElements(model);
  std::vector<std::vector<double>> of_two(model.images.size());
  std::vector<std::vector<double>> of_more(model.images.size());
  std::vector<double> all;
  for (const Point3D& point : model.points3D) {
    auto& of_image =
        point.track_end - point.track_begin == 2 ? of_two : of_more;
    for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
      if (!std::isfinite(errors_px[e])) continue;
      of_image[image_of[e]].push_back(errors_px[e]);
      all.push_back(errors_px[e]);
    }
  }
  double limit = 0;
  if (!all.empty()) {
    const auto rank = all.begin() + (999 * all.size() - 1) / 1000;
    std::nth_element(all.begin(), rank, all.end());
    limit = *rank;
  }
  std::vector<ErrorsInDisc> discs;
  for (size_t n = 0; n < model.images.size(); ++n) {
    discs.emplace_back(of_more[n], of_two[n], limit);
  }
  return discs;
}

}  // namespace krot::internal
