#include "krot/adjust/adjustment_blocks.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include <ceres/jet.h>

#include "krot/base/numbers.h"
#include "krot/base/parallel_for.h"
#include "krot/camera/camera_model.h"
#include "krot/camera/models.h"
#include "krot/geometry.h"

namespace krot::internal {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int32_t kHeld = AdjustmentColumns::kHeld;
// No camera model has more parameters.
constexpr int kMaxCameraParams = 16;

std::vector<Eigen::Matrix3d> Rotations(const std::vector<PoseBlock>& poses) {
  std::vector<Eigen::Matrix3d> rotations;
  rotations.reserve(poses.size());
  for (const PoseBlock& pose : poses) rotations.push_back(RotationOf(pose));
  return rotations;
}

template <typename Camera>
class PixelOf {
 public:
  static DifferentiatedPixel Differentiate(const double* params,
                                           const Eigen::Vector2d& ray,
                                           double* J_params) {
    return J_params == nullptr
               ? DifferentiateBy<0>(params, ray, nullptr)
               : DifferentiateBy<kNumShape>(params, ray, J_params);
  }

 private:
  // Parameters of lens and distortion, which come last.
  static constexpr int kNumShape =
      Camera::Lens::kNumParams + Camera::Distortion::kNumParams;
  static constexpr int kNumParams = Camera::kNumParams;
  static_assert(kNumParams <= kMaxCameraParams);
  static constexpr int kNumFocal = kNumParams - kNumShape - 2;

  template <int kNumDerivatives>
  static DifferentiatedPixel DifferentiateBy(const double* params,
                                             const Eigen::Vector2d& ray,
                                             double* to) {
    using Jet = ceres::Jet<double, 2 + kNumDerivatives>;
    const Jet u(ray.x(), 0);
    const Jet v(ray.y(), 1);
    Jet x, y;  // before focal length
    if constexpr (kNumDerivatives > 0) {
      Jet jets[kNumParams];
      for (int i = 0; i < kNumShape; ++i) {
        jets[kNumFocal + 2 + i] = Jet(params[kNumFocal + 2 + i], 2 + i);
      }
      Shape(jets, u, v, &x, &y);
    } else {
      Shape(params, u, v, &x, &y);
    }
    const double fx = Camera::FocalX(params), fy = Camera::FocalY(params);
    DifferentiatedPixel result;
    result.pixel << fx * x.a + Camera::CenterX(params),
        fy * y.a + Camera::CenterY(params);
    result.J_ray.row(0) = fx * x.v.template head<2>();
    result.J_ray.row(1) = fy * y.v.template head<2>();
    if (to == nullptr) return result;

    Eigen::Map<Eigen::Matrix<double, 2, kNumParams, Eigen::RowMajor>> J_params(
        to);
    J_params.setZero();
    J_params(0, 0) = x.a;
    J_params(1, kNumFocal - 1) = y.a;
    J_params.template middleCols<2>(kNumFocal).setIdentity();
    if constexpr (kNumDerivatives > 0) {
      J_params.row(0).template tail<kNumShape>() =
          fx * x.v.template tail<kNumShape>();
      J_params.row(1).template tail<kNumShape>() =
          fy * y.v.template tail<kNumShape>();
    }
    return result;
  }

  template <typename P, typename Jet>
  static void Shape(const P* params, const Jet& u, const Jet& v, Jet* x,
                    Jet* y) {
    Jet a, b;
    Camera::Lens::FromRay(Camera::LensParams(params), u, v, &a, &b);
    Camera::Distortion::Apply(Camera::DistortionParams(params), a, b, x, y);
  }
};

struct PlacedPose {
  explicit PlacedPose(const PoseBlock& block)
      : transform{RotationOf(block), TranslationOf(block)},
        center(CenterOf(block)) {}

  RigidTransform transform;
  Vector3d center;
};

// Writes the derivatives by the pose of R (x - c), given those by x, and
// returns where the next ones go.
Matrix3d* StorePose(const AdjustmentColumns::Pose& columns, const Matrix3d& D_x,
                    const Vector3d& x_less_center, Matrix3d* to) {
  if (columns.rotation != kHeld) {
    for (int row = 0; row < 3; ++row) {  // a . (theta x d) = theta . (d x a)
      to->row(row) = x_less_center.cross(D_x.row(row).transpose());
    }
    ++to;
  }
  if (columns.center != kHeld) *to++ = -D_x;
  return to;
}

// Writes the derivatives by the parameters of a camera, and returns those by
// x_cam.
Matrix3d Project(int camera_model, const std::vector<double>& params,
                 const Vector3d& x_cam,
                 const AdjustmentColumns::Camera& columns, Matrix3d* to) {
  const Eigen::Vector2d ray = x_cam.hnormalized();
  const auto num_params = static_cast<int>(params.size());
  double J_params[2 * kMaxCameraParams];  // row by row
  const DifferentiatedPixel projected =
      DifferentiatePixel({camera_model, params.data()}, ray,
                         columns.params.empty() ? nullptr : J_params);
  for (size_t n = 0; n < columns.params.size(); ++n) {
    const int param = columns.params[n];
    to[n / 3].col(n % 3).head<2>() << J_params[param],
        J_params[num_params + param];
  }
  Matrix3d D;
  D.topRows<2>() << projected.J_ray, -projected.J_ray * ray;
  D.topRows<2>() /= x_cam.z();
  D.row(2) = Eigen::RowVector3d::UnitZ();
  return D;
}

}  // namespace

std::optional<std::vector<ProjectedError>> ProjectErrors(
    const AdjustmentBlocks& blocks, double max_error, int num_threads) {
  const std::vector<Eigen::Matrix3d> frames = Rotations(blocks.frames);
  const std::vector<Eigen::Matrix3d> sensors = Rotations(blocks.sensors);
  const auto project = [&](const AdjustmentObservation& observation) {
    const int32_t f = observation.frame, s = observation.sensor;
    Eigen::Vector3d x = frames[f] * blocks.points[observation.point] +
                        TranslationOf(blocks.frames[f]);
    if (s >= 0) x = sensors[s] * x + TranslationOf(blocks.sensors[s]);
    const int32_t c = observation.camera;
    return ProjectedError{
        ProjectRay({blocks.camera_models[c], blocks.cameras[c].data()},
                   x.hnormalized()) -
            observation.pixel,
        x.z()};
  };
  const auto count = static_cast<int64_t>(blocks.observations.size());
  std::vector<ProjectedError> errors(count);
  std::atomic<bool> is_feasible{true};
  ParallelForEach(count, num_threads, [&](int64_t i) {
    if (!is_feasible) return;
    errors[i] = project(blocks.observations[i]);
    if (!(errors[i].w > 0 && errors[i].r.norm() < max_error)) {
      is_feasible = false;
    }
  });
  if (!is_feasible) return std::nullopt;
  return errors;
}

double HalfSquaredNorm(const std::vector<ProjectedError>& errors) {
  double sum = 0;
  for (const ProjectedError& error : errors) sum += error.r.squaredNorm();
  return sum / 2;
}

double LargestError(const std::vector<ProjectedError>& errors) {
  double largest2 = 0;
  for (const ProjectedError& error : errors) {
    largest2 = std::max(largest2, error.r.squaredNorm());
  }
  return std::sqrt(largest2);
}

DifferentiatedPixel DifferentiatePixel(Intrinsics intrinsics,
                                       const Eigen::Vector2d& ray,
                                       double* J_params) {
  return VisitCameraModel(intrinsics.model_id, [&](auto camera) {
    return PixelOf<decltype(camera)>::Differentiate(intrinsics.params, ray,
                                                    J_params);
  });
}

ErrorJacobians::ErrorJacobians(const AdjustmentColumns& columns,
                               const AdjustmentBlocks& blocks)
    : columns_(columns) {
  const auto add = [&](int32_t block) {
    if (block != kHeld) blocks_.push_back(block);
  };
  for (const AdjustmentObservation& observation : blocks.observations) {
    begin_.push_back(static_cast<int64_t>(blocks_.size()));
    blocks_.push_back(kHeld);
    add(columns.frames[observation.frame].rotation);
    add(columns.frames[observation.frame].center);
    if (observation.sensor >= 0) {
      add(columns.sensors[observation.sensor].rotation);
      add(columns.sensors[observation.sensor].center);
    }
    const AdjustmentColumns::Camera& camera =
        columns.cameras[observation.camera];
    for (int32_t n = 0; n < camera.num_blocks(); ++n) {
      add(camera.first_block + n);
    }
    add(columns.kept_points[observation.point]);
    add(columns.cap);
  }
  begin_.push_back(static_cast<int64_t>(blocks_.size()));
  D_.assign(blocks_.size(), Matrix3d::Zero());
}

std::vector<int32_t> ErrorJacobians::BlocksOf(int64_t begin,
                                              int64_t end) const {
  std::vector<int32_t> all;
  for (int64_t i = begin; i < end; ++i) {
    all.insert(all.end(), blocks(i), blocks(i) + num_blocks(i));
  }
  SortUnique(&all);
  return all;
}

void ErrorJacobians::Evaluate(const AdjustmentBlocks& blocks, int num_threads) {
  const std::vector<PlacedPose> frames(blocks.frames.begin(),
                                       blocks.frames.end());
  const std::vector<PlacedPose> sensors(blocks.sensors.begin(),
                                        blocks.sensors.end());
  const auto evaluate = [&](const AdjustmentObservation& o, Matrix3d* D) {
    Matrix3d* by_point = D++;
    Matrix3d* by_frame = D;
    const AdjustmentColumns::Pose& frame_columns = columns_.frames[o.frame];
    D += (frame_columns.rotation != kHeld) + (frame_columns.center != kHeld);
    const PlacedPose& frame = frames[o.frame];
    const Vector3d& x = blocks.points[o.point];
    const Vector3d x_rig = frame.transform * x;
    Vector3d x_cam = x_rig;
    Matrix3d* by_sensor = D;
    if (o.sensor >= 0) {
      x_cam = sensors[o.sensor].transform * x_rig;
      const AdjustmentColumns::Pose& columns = columns_.sensors[o.sensor];
      D += (columns.rotation != kHeld) + (columns.center != kHeld);
    }
    Matrix3d D_rig =
        Project(blocks.camera_models[o.camera], blocks.cameras[o.camera], x_cam,
                columns_.cameras[o.camera], D);
    if (o.sensor >= 0) {
      const PlacedPose& sensor = sensors[o.sensor];
      D_rig = D_rig * sensor.transform.rotation;
      StorePose(columns_.sensors[o.sensor], D_rig, x_rig - sensor.center,
                by_sensor);
    }
    by_point->noalias() = D_rig * frame.transform.rotation;
    if (columns_.kept_points[o.point] != kHeld) {
      D[columns_.cameras[o.camera].num_blocks()] = *by_point;
    }
    StorePose(frame_columns, *by_point, x - frame.center, by_frame);
  };
  ParallelForEach(
      static_cast<int64_t>(blocks.observations.size()), num_threads,
      [&](int64_t i) { evaluate(blocks.observations[i], &D_[begin_[i]]); });
}

}  // namespace krot::internal
