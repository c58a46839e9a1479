#include "krot/analysis/camera_check.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <Eigen/Core>

#include "krot/base/numbers.h"
#include "krot/camera/camera_model.h"
#include "krot/linear/blocks.h"

namespace krot::internal {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Matrix23 = Eigen::Matrix<double, 2, 3>;

// Of the squared errors of a camera's images. In real models that were adjusted
// with their cameras free, it is 0.17 at most where a camera took one image
// (its principal point, which was held), and 0.04 where it took several.
constexpr double kLeastGain = 0.1;
constexpr double kLeastGainOfOneImage = 0.2;

// Cameras of their own for more images would take gigabytes.
constexpr size_t kMostOwnCameras = 500;

class CameraChecker {
 public:
  // Keeps references.
  CameraChecker(const Model& model, const ModelNoise& noise,
                const PoseRows& rows, const std::vector<PoseSums>& sums,
                const Lenses& lenses, int least_num_images, double false_alarm,
                int num_threads)
      : model_(model),
        noise_(noise),
        lenses_(lenses),
        rows_(rows),
        shared_(lenses, rows.geometries(), sums),
        least_num_images_(least_num_images),
        num_threads_(num_threads) {
    least_exponent_ =
        std::log(static_cast<double>(Groups().size()) / false_alarm);
  }

  std::vector<WrongCamera> Run() {
    if (!DropUnsuspected()) return {};
    GainSystem system =
        EliminatePoses(model_, rows_, shared_, length_, num_threads_);
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
      const Camera& lens = lenses_.cameras[group.camera];
      if (lens.params[group.params[i]] + step[i] <= 0) return false;
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
      is_suspected.push_back(Groups()[n].num_images >= least_num_images_ &&
                             ExponentOf(gain, Groups()[n]) > least_exponent_);
    }
    shared_.Keep(is_suspected);
    return shared_.num_columns() > 0;
  }

  WrongCamera Describe(const SharedGroup& group, double gain,
                       const VectorXd& step) const {
    const Camera& camera = lenses_.cameras[group.camera];
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
      case CameraFault::kAspectRatio:
      case CameraFault::kLens:
      case CameraFault::kSharing:
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
  const Lenses& lenses_;
  const PoseRows& rows_;
  SharedColumns shared_;
  const int least_num_images_;
  const int num_threads_;
  double least_exponent_ = 0;
  double length_ = 1;  // the median distance of a point from a camera
};

Lenses LensesOf(const Model& model) {
  Lenses lenses;
  lenses.cameras = model.cameras;
  for (const ImageGeometry& geometry : ImageGeometries(model)) {
    lenses.of_image.push_back(geometry.camera);
  }
  return lenses;
}

// The same camera in the model OPENCV (fx, fy, cx, cy, k1, k2, p1, p2), if that
// has all that its own has.
Camera InOpenCv(Camera camera) {
  const std::string_view name = FindCameraModel(camera.model_id)->name;
  const bool has_one =
      name == "SIMPLE_RADIAL" || name == "RADIAL" || name == "SIMPLE_PINHOLE";
  if (!has_one && name != "PINHOLE") return camera;
  if (has_one) camera.params.insert(camera.params.begin(), camera.params[0]);
  camera.params.resize(8, 0);
  camera.model_id = FindCameraModel("OPENCV")->id;
  return camera;
}

// Every image with a camera of its own, whose id is the image's index.
Lenses Unshared(const Lenses& shared) {
  Lenses own;
  own.can_move_in_rigs = shared.can_move_in_rigs;
  for (const int32_t c : shared.of_image) {
    const auto n = static_cast<int32_t>(own.cameras.size());
    own.of_image.push_back(n);
    own.cameras.push_back(shared.cameras[c]);
    own.cameras.back().id = static_cast<CameraId>(n);
  }
  return own;
}

}  // namespace

std::vector<WrongCamera> FindWrongCameras(const Model& model,
                                          const ModelNoise& noise,
                                          bool is_adjusted, bool errors_agree,
                                          double false_alarm, int num_threads) {
  const PoseRows rows(model, noise);
  const std::vector<PoseSums> sums = AddUpImages(model, noise);
  const auto judge = [&](const Lenses& lenses, int least_num_images) {
    return CameraChecker(model, noise, rows, sums, lenses, least_num_images,
                         false_alarm, num_threads)
        .Run();
  };
  Lenses rich = LensesOf(model);
  std::vector<WrongCamera> wrong = judge(rich, is_adjusted ? 1 : 2);
  if (!wrong.empty() || !is_adjusted || *noise.sigma_px < kLeastNoisePx) {
    return wrong;
  }
  rich.can_move_in_rigs = false;
  std::map<CameraId, int64_t> num_images;
  std::map<CameraId, std::string> model_names;
  for (const int32_t c : rich.of_image) ++num_images[rich.cameras[c].id];
  for (Camera& camera : rich.cameras) {
    model_names[camera.id] = FindCameraModel(camera.model_id)->name;
    camera = InOpenCv(std::move(camera));
  }
  wrong = judge(rich, 2);
  for (WrongCamera& camera : wrong) {
    camera.model_name = model_names[camera.camera_id];
    if (camera.fault == CameraFault::kFocalLength &&
        FindCameraModel(camera.model_name)->num_focal_lengths() == 1) {
      camera.fault = CameraFault::kAspectRatio;
    } else if (camera.fault == CameraFault::kDistortion) {
      camera.fault = CameraFault::kLens;
    }
  }
  if (!wrong.empty() || !errors_agree ||
      model.images.size() > kMostOwnCameras) {
    return wrong;
  }
  for (const WrongCamera& of_image : judge(Unshared(rich), 1)) {
    const Image& image = model.images[of_image.camera_id];
    if (num_images[image.camera_id] == 1) continue;
    const auto same = std::find_if(wrong.begin(), wrong.end(),
                                   [&](const WrongCamera& camera) {
                                     return camera.camera_id == image.camera_id;
                                   });
    WrongCamera& camera = same == wrong.end() ? wrong.emplace_back() : *same;
    camera.camera_id = image.camera_id;
    camera.fault = CameraFault::kSharing;
    camera.num_images = num_images[image.camera_id];
    camera.image_names.push_back(image.name);
  }
  return wrong;
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
