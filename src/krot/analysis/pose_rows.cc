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
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Matrix23 = Eigen::Matrix<double, 2, 3>;
using Matrix26 = Eigen::Matrix<double, 2, 6>;
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
    row.relative_sigma = noise_.observations[e].relative_sigma;
    row.error = noise_.observations[e].error_px / row.relative_sigma;
    const Matrix23 by_cam = projected->by_cam / row.relative_sigma;
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

Matrix26 PoseRows::ByFrame(const PoseRow& row) const {
  const ImageGeometry& geometry = geometries_[row.image];
  const Matrix3d world_from_rig = geometry.rig_from_world.rotation.transpose();
  Matrix26 F;
  F << row.F.leftCols<3>() * geometry.cam_from_rig.rotation +
           row.F.rightCols<3>() * world_from_rig *
               CrossMatrix(Center(geometry.cam_from_rig)),
      row.F.rightCols<3>();
  return F;
}

SharedColumns::SharedColumns(const Model& model,
                             const std::vector<ImageGeometry>& geometries,
                             const std::vector<PoseSums>& sums)
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
      if (above && below) {
        by.C.col(i) = (*above - *below) / (2 * step * row.relative_sigma);
      }
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

// Of a track, `error` and its derivatives `F` by the pose and `A` by the point;
// root G with G G' = (A'A)^-1 over the whole track.
template <int N>
void Add(const Eigen::Matrix<double, N, 6>& F,
         const Eigen::Matrix<double, N, 3>& A,
         const Eigen::Matrix<double, N, 1>& error, const Matrix3d& root,
         PoseSums* sums) {
  using Square = Eigen::Matrix<double, N, N>;
  const Eigen::Matrix<double, N, 3> B = A * root;
  const Square R =
      Square::Identity(B.rows(), B.rows()) - Square(B * B.transpose());
  const auto [values, vectors] = [&R] {
    if constexpr (N == 2) {
      Eigen::SelfAdjointEigenSolver<Square> of_R;
      of_R.computeDirect(R);
      return std::pair(of_R.eigenvalues(), of_R.eigenvectors());
    } else {
      return EigenpairsOf(R);
    }
  }();
  for (Index j = 0; j < R.rows(); ++j) {
    const double r = values[j];
    if (r < kControlled) continue;
    const Eigen::Matrix<double, N, 1> direction = vectors.col(j);
    const Vector6 f = F.transpose() * direction;
    const double along = direction.dot(error);
    sums->M.noalias() += r * f * f.transpose();
    sums->g.noalias() += along * f;
    sums->square += along * along / r;
    ++sums->num_directions;
  }
}

void FindSteps(std::vector<PoseSums>* sums) {
  for (PoseSums& one : *sums) one.step = DeterminedStep(one.M, one.g);
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

double PoseSums::CenterSpread() const {
  return LargestSpread(M.bottomRightCorner<3, 3>(), M.bottomLeftCorner<3, 3>(),
                       M.topLeftCorner<3, 3>());
}

double PoseSums::TurnSpread() const {
  return LargestSpread(M.topLeftCorner<3, 3>(), M.topRightCorner<3, 3>(),
                       M.bottomRightCorner<3, 3>());
}

double PoseSums::GainExponent(double sigma_px) const {
  return internal::GainExponent(Gain(), square, num_directions, 6, sigma_px);
}

std::vector<PoseSums> AddUpImages(const Model& model, const ModelNoise& noise) {
  const PoseRows all(model, noise);
  std::vector<PoseSums> sums(model.images.size());
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const std::vector<PoseRow> rows = all.Of(k);
    const Matrix3d root = PoseRows::RootOf(rows);
    for (const PoseRow& row : rows) {
      Add<2>(row.F, row.F.rightCols<3>(), row.error, root, &sums[row.image]);
    }
  }
  FindSteps(&sums);
  return sums;
}

std::vector<PoseSums> AddUpFrames(const Model& model, const ModelNoise& noise) {
  const bool has_rigs =
      std::any_of(model.frames.begin(), model.frames.end(),
                  [](const Frame& frame) { return frame.data.size() > 1; });
  if (!has_rigs) return AddUpImages(model, noise);
  const PoseRows all(model, noise);
  std::vector<PoseSums> sums(model.frames.size());
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    const std::vector<PoseRow> rows = all.Of(k);
    const Matrix3d root = PoseRows::RootOf(rows);
    std::map<int32_t, std::vector<const PoseRow*>> of_frames;
    for (const PoseRow& row : rows) {
      of_frames[all.geometries()[row.image].frame].push_back(&row);
    }
    for (const auto& [frame, of_frame] : of_frames) {
      const auto size = static_cast<Index>(2 * of_frame.size());
      Eigen::Matrix<double, Eigen::Dynamic, 6> F(size, 6);
      Eigen::Matrix<double, Eigen::Dynamic, 3> A(size, 3);
      Eigen::VectorXd error(size);
      for (Index i = 0; i < size; i += 2) {
        const PoseRow& row = *of_frame[i / 2];
        F.middleRows<2>(i) = all.ByFrame(row);
        A.middleRows<2>(i) = row.F.rightCols<3>();
        error.segment<2>(i) = row.error;
      }
      Add<Eigen::Dynamic>(F, A, error, root, &sums[frame]);
    }
  }
  FindSteps(&sums);
  std::vector<PoseSums> of_images(model.images.size());
  for (size_t n = 0; n < of_images.size(); ++n) {
    const ImageGeometry& geometry = all.geometries()[n];
    if (geometry.has_pose) of_images[n] = sums[geometry.frame];
  }
  return of_images;
}

}  // namespace krot::internal
