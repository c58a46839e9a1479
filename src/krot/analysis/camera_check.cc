#include "krot/analysis/camera_check.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <Eigen/Core>

#include "krot/base/numbers.h"
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

// Of the squared errors of a camera's images. In real models that were adjusted
// with their cameras free, it is 0.17 at most where a camera took one image
// (its principal point, which was held), and 0.04 where it took several.
constexpr double kLeastGain = 0.1;
constexpr double kLeastGainOfOneImage = 0.2;

// What the columns of cameras gain, the points and the poses eliminated: D =
// C'C and g = C'e.
struct GainSystem {
  explicit GainSystem(Index size)
      : D(MatrixXd::Zero(size, size)), g(VectorXd::Zero(size)) {}

  VectorXd StepOf(const SharedGroup& group) const {
    return DeterminedStep<VectorXd>(
        D.block(group.begin, group.begin, group.size, group.size),
        g.segment(group.begin, group.size));
  }
  double GainOf(const SharedGroup& group) const {
    return group.size == 0 || g.size() == 0
               ? 0
               : -g.segment(group.begin, group.size).dot(StepOf(group));
  }

  // Frees the group's columns: what is left is the gain beside it.
  void Free(const SharedGroup& group) {
    if (group.size == 0) return;
    const MatrixXd rows = D.middleRows(group.begin, group.size);
    const MatrixXd own = rows.middleCols(group.begin, group.size);
    MatrixXd steps(group.size, g.size());
    for (Index c = 0; c < g.size(); ++c) {
      steps.col(c) = DeterminedStep<VectorXd>(own, rows.col(c));
    }
    g += rows.transpose() *
         DeterminedStep<VectorXd>(own, g.segment(group.begin, group.size));
    D += rows.transpose() * steps;
  }

  MatrixXd D;
  VectorXd g;
};

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

class CameraChecker {
 public:
  CameraChecker(const Model& model, const ModelNoise& noise,
                int least_num_images, double false_alarm, int num_threads)
      : model_(model),
        noise_(noise),
        rows_(model, noise),
        shared_(model, rows_.geometries(), AddUpImages(model, noise)),
        least_num_images_(least_num_images),
        num_threads_(num_threads) {
    least_exponent_ =
        std::log(static_cast<double>(Groups().size()) / false_alarm);
  }

  std::vector<WrongCamera> Run() {
    if (!DropUnsuspected()) return {};
    GainSystem system =
        PoseElimination(model_, rows_, shared_, length_).Run(num_threads_);
    std::vector<WrongCamera> wrong;
    std::vector<char> is_free(Groups().size(), 0);
    for (;;) {
      const SharedGroup* best = nullptr;
      double most = 0;
      for (size_t i = 0; i < Groups().size(); ++i) {
        if (is_free[i]) continue;
        const SharedGroup& group = Groups()[i];
        const double gain = system.GainOf(group);
        if (gain <= most || !IsWrong(gain, group) ||
            !IsPossible(system.StepOf(group), group)) {
          continue;
        }
        best = &group;
        most = gain;
      }
      if (best == nullptr) return wrong;
      wrong.push_back(Describe(*best, most, system.StepOf(*best)));
      for (size_t i = 0; i < Groups().size(); ++i) {
        // All parameters of a lens take part in the same fault.
        const bool is_same =
            Groups()[i].camera == best->camera && Groups()[i].rig == best->rig;
        if (is_free[i] || !is_same) continue;
        system.Free(Groups()[i]);
        is_free[i] = 1;
      }
    }
  }

 private:
  const std::vector<SharedGroup>& Groups() const { return shared_.groups(); }
  bool IsWrong(double gain, const SharedGroup& group) const {
    const double least =
        group.num_images > 1 ? kLeastGain : kLeastGainOfOneImage;
    return group.num_images >= least_num_images_ &&
           gain > least * group.square &&
           ExponentOf(gain, group) > least_exponent_;
  }

  // Far from the truth a step may ask for a negative focal length.
  bool IsPossible(const VectorXd& step, const SharedGroup& group) const {
    if (group.fault != CameraFault::kFocalLength) return true;
    for (Index i = 0; i < group.size; ++i) {
      if (model_.cameras[group.camera].params[group.params[i]] + step[i] <= 0) {
        return false;
      }
    }
    return true;
  }

  double ExponentOf(double gain, const SharedGroup& group) const {
    return GainExponent(gain, group.square, group.num_directions,
                        static_cast<int>(group.size), *noise_.sigma_px);
  }

  // Groups that gain too little with the poses held lose their columns. False
  // if none is left.
  bool DropUnsuspected() {
    std::vector<MatrixXd> D;
    std::vector<VectorXd> g;
    for (const SharedGroup& group : Groups()) {
      D.emplace_back(MatrixXd::Zero(group.size, group.size));
      g.emplace_back(VectorXd::Zero(group.size));
    }
    std::vector<double> lengths;
    std::map<int32_t, MatrixXd> of_track;
    for (size_t k = 0; k < model_.points3D.size(); ++k) {
      const std::vector<PoseRow> rows = rows_.Of(k);
      if (rows.empty()) continue;
      const Matrix3d root = PoseRows::RootOf(rows);
      of_track.clear();
      Vector3d G_e = Vector3d::Zero();
      for (const PoseRow& row : rows) {
        lengths.push_back(row.x_cam.norm());
        const Matrix23 Q = row.F.rightCols<3>() * root;
        G_e += Q.transpose() * row.error;
        for (const auto& [n, C] : shared_.ByGroups(row)) {
          D[n] += C.transpose() * C;
          g[n] += C.transpose() * row.error;
          of_track.try_emplace(n, MatrixXd::Zero(3, C.cols())).first->second +=
              Q.transpose() * C;
        }
      }
      for (const auto& [n, G] : of_track) {
        D[n] -= G.transpose() * G;
        g[n] -= G.transpose() * G_e;
      }
    }
    if (lengths.empty()) return false;
    length_ = LowerMedian(std::move(lengths));
    std::vector<char> is_suspected;
    for (size_t n = 0; n < Groups().size(); ++n) {
      const double gain = -g[n].dot(DeterminedStep(D[n], g[n]));
      is_suspected.push_back(ExponentOf(gain, Groups()[n]) > least_exponent_);
    }
    shared_.Keep(is_suspected);
    return shared_.num_columns() > 0;
  }

  WrongCamera Describe(const SharedGroup& group, double gain,
                       const VectorXd& step) const {
    const Camera& camera = model_.cameras[group.camera];
    WrongCamera wrong;
    wrong.camera_id = camera.id;
    wrong.fault = group.fault;
    wrong.gain = std::min(1.0, gain / group.square);
    wrong.num_images = group.num_images;
    switch (group.fault) {
      case CameraFault::kFocalLength:
        for (Index i = 0; i < group.size; ++i) {
          const double f = camera.params[group.params[i]];
          wrong.focal_length_px += f / static_cast<double>(group.size);
          wrong.asked_focal_length_px +=
              (f + step[i]) / static_cast<double>(group.size);
        }
        break;
      case CameraFault::kPrincipalPoint:
        wrong.offset_px = step.norm();
        break;
      case CameraFault::kDistortion:
      case CameraFault::kImages:
        break;
      case CameraFault::kPlaceInRig:
        wrong.turn_deg = kDegreesPerRadian * step.head<3>().norm();
        wrong.shift = step.tail<3>().norm();
        break;
    }
    return wrong;
  }

  const Model& model_;
  const ModelNoise& noise_;
  const PoseRows rows_;
  SharedColumns shared_;
  const int least_num_images_;
  const int num_threads_;
  double least_exponent_ = 0;
  double length_ = 1;  // the median distance of a point from a camera
};

}  // namespace

std::vector<WrongCamera> FindWrongCameras(const Model& model,
                                          const ModelNoise& noise,
                                          int least_num_images,
                                          double false_alarm, int num_threads) {
  return CameraChecker(model, noise, least_num_images, false_alarm, num_threads)
      .Run();
}

void AddCamerasOfWrongImages(const Model& model, ModelCheck* check) {
  struct Images {
    int64_t num_wrong = 0, num_others = 0;
  };
  std::map<CameraId, Images> images_of;
  for (size_t n = 0; n < model.images.size(); ++n) {
    const ImageCheck& image = check->images[n];
    if (image.num_observations == 0) continue;
    Images& images = images_of[model.images[n].camera_id];
    ++(image.verdict == ImageVerdict::kWrong ? images.num_wrong
                                             : images.num_others);
  }
  for (const auto& [camera_id, images] : images_of) {
    if (images.num_others > 0 || images.num_wrong < 3) continue;
    WrongCamera& camera = check->cameras.emplace_back();
    camera.camera_id = camera_id;
    camera.fault = CameraFault::kImages;
    camera.num_images = images.num_wrong;
    check->is_adjusted = false;
  }
}

}  // namespace krot::internal
