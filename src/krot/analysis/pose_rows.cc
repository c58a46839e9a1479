#include "krot/analysis/camera_check.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/geometry/transform.h"
#include "krot/linear/blocks.h"
#include "krot/linear/reduced_camera_system.h"

namespace krot::internal {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Matrix23 = Eigen::Matrix<double, 2, 3>;
using Matrix26 = Eigen::Matrix<double, 2, 6>;

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

SharedColumns::SharedColumns(const Lenses& lenses,
                             const std::vector<ImageGeometry>& geometries,
                             const std::vector<PoseSums>& sums)
    : lenses_(lenses), geometries_(geometries) {
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
    for (const int32_t g : groups_of_camera_[lenses_.of_image[n]]) add(g);
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
  groups_of_camera_.resize(lenses_.cameras.size());
  for (size_t c = 0; c < lenses_.cameras.size(); ++c) {
    const Camera& camera = lenses_.cameras[c];
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
    if (!geometry.has_pose || geometry.sensor < 0 ||
        !lenses_.can_move_in_rigs) {
      continue;
    }
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
  const int32_t lens = lenses_.of_image[row.image];
  Camera camera = lenses_.cameras[lens];
  for (const int32_t n : groups_of_camera_[lens]) {
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

// Eliminates the points and then the poses of frames from the normal equations
// with the columns of cameras.
class PoseElimination {
 public:
  // Keeps references. `length` is the unit in which centres move.
  PoseElimination(const Model& model, const PoseRows& rows,
                  const SharedColumns& shared, double length)
      : model_(model),
        rows_(rows),
        shared_(shared),
        length_(length),
        num_columns_(shared.num_columns()),
        of_cameras_(num_columns_) {}

  // Without columns if the poses cannot be eliminated.
  GainSystem Run(int num_threads) {
    BlockStructure structure;
    structure.point_begin = {0};
    std::vector<std::vector<PoseRow>> tracks;
    for (size_t k = 0; k < model_.points3D.size(); ++k) {
      std::vector<PoseRow> rows = rows_.Of(k);
      if (rows.empty()) continue;
      for (const PoseRow& row : rows) {
        const int32_t frame = FrameOf(row);
        structure.frame_of.push_back(2 * frame);
        structure.frame_of.push_back(2 * frame + 1);
      }
      structure.point_begin.push_back(
          static_cast<int64_t>(structure.frame_of.size()));
      tracks.push_back(std::move(rows));
    }
    structure.frame_is_fixed.assign(2 * model_.frames.size(), 1);
    for (const int32_t f : structure.frame_of) structure.frame_is_fixed[f] = 0;
    ReducedCameraSystem system(structure);
    system.SetZero();
    T_ = MatrixXd::Zero(system.num_columns(), num_columns_ + 1);
    for (const std::vector<PoseRow>& rows : tracks) AddTrack(rows, &system);
    if (!system.Factorize(num_threads)) return GainSystem(0);
    MatrixXd X(T_.rows(), T_.cols());
    for (Index c = 0; c < T_.cols(); ++c) {
      X.col(c) = system.Solve(T_.col(c), 1e-8);
    }
    const auto T = T_.leftCols(num_columns_);
    of_cameras_.D -= T.transpose() * X.leftCols(num_columns_);
    of_cameras_.g -= T.transpose() * X.col(num_columns_);
    of_cameras_.D = (of_cameras_.D + of_cameras_.D.transpose()).eval() / 2;
    return std::move(of_cameras_);
  }

 private:
  // The centre in units of length.
  Matrix26 ByFrame(const PoseRow& row) const {
    Matrix26 F = rows_.ByFrame(row);
    F.rightCols<3>() *= length_;
    return F;
  }

  int32_t FrameOf(const PoseRow& row) const {
    return rows_.geometries()[row.image].frame;
  }

  void AddTrack(const std::vector<PoseRow>& rows, ReducedCameraSystem* system) {
    const std::vector<SharedGroup>& groups = shared_.groups();
    MatrixXd& D = of_cameras_.D;
    VectorXd& g = of_cameras_.g;
    const Matrix3d root = PoseRows::RootOf(rows);
    std::vector<int32_t> nodes;
    for (const PoseRow& row : rows) {
      nodes.push_back(2 * FrameOf(row));
      nodes.push_back(2 * FrameOf(row) + 1);
    }
    SortUnique(&nodes);
    // Rows of G are contiguous.
    Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor> G(
        3, 3 * static_cast<Index>(nodes.size()));
    G.setZero();
    std::map<int32_t, MatrixXd> G_of;
    Vector3d G_e = Vector3d::Zero();
    for (const PoseRow& row : rows) {
      const int32_t node = 2 * FrameOf(row);
      const Matrix23 Q = row.F.rightCols<3>() * root;
      const Matrix26 F = ByFrame(row);
      const Index slot =
          3 *
          (std::lower_bound(nodes.begin(), nodes.end(), node) - nodes.begin());
      G.middleCols<6>(slot) += Q.transpose() * F;
      G_e += Q.transpose() * row.error;
      for (const auto& [a, b] : {std::pair(0, 0), {1, 0}, {1, 1}}) {
        const Matrix3d block = F.middleCols<3>(Index{3} * a).transpose() *
                               F.middleCols<3>(Index{3} * b);
        system->AddBlock(0, node + a, node + b, block.data());
      }
      const Index column = system->column(node);
      T_.block<6, 1>(column, num_columns_) += F.transpose() * row.error;
      const std::vector<ByGroup> all = shared_.ByGroups(row);
      for (const auto& [n, C] : all) {
        const SharedGroup& group = groups[n];
        T_.block(column, group.begin, 6, group.size) += F.transpose() * C;
        g.segment(group.begin, group.size) += C.transpose() * row.error;
        G_of.try_emplace(n, MatrixXd::Zero(3, group.size)).first->second +=
            Q.transpose() * C;
        for (const auto& [m, other] : all) {
          D.block(group.begin, groups[m].begin, group.size, groups[m].size) +=
              C.transpose() * other;
        }
      }
    }
    const double* const rows_of_G[3] = {G.row(0).data(), G.row(1).data(),
                                        G.row(2).data()};
    system->SubtractSquare(0, nodes, std::vector<char>(nodes.size(), 0),
                           rows_of_G);
    for (size_t a = 0; a < nodes.size(); ++a) {
      const Eigen::Matrix3d G_a = G.middleCols<3>(static_cast<Index>(3 * a));
      const Index column = system->column(nodes[a]);
      T_.block<3, 1>(column, num_columns_) -= G_a.transpose() * G_e;
      for (const auto& [n, G_n] : G_of) {
        T_.block(column, groups[n].begin, 3, groups[n].size) -=
            G_a.transpose() * G_n;
      }
    }
    for (const auto& [n, G_n] : G_of) {
      g.segment(groups[n].begin, groups[n].size) -= G_n.transpose() * G_e;
      for (const auto& [m, G_m] : G_of) {
        D.block(groups[n].begin, groups[m].begin, groups[n].size,
                groups[m].size) -= G_n.transpose() * G_m;
      }
    }
  }

  const Model& model_;
  const PoseRows& rows_;
  const SharedColumns& shared_;
  const double length_;
  const Index num_columns_;
  MatrixXd T_;  // F'C and F'e, its last column
  GainSystem of_cameras_;
};

}  // namespace

GainSystem EliminatePoses(const Model& model, const PoseRows& rows,
                          const SharedColumns& shared, double length,
                          int num_threads) {
  return PoseElimination(model, rows, shared, length).Run(num_threads);
}

}  // namespace krot::internal
