#include "krot/adjust/error_jacobians.h"

#include "krot/adjust/differentiated_pixel.h"
#include "krot/base/parallel_for.h"
#include "krot/camera/camera_model.h"
#include "krot/geometry/rigid_transform.h"

namespace krot {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr int64_t kObservationsPerChunk = 1024;
constexpr int32_t kHeld = AdjustmentColumns::kHeld;

struct PlacedPose {
  explicit PlacedPose(const PoseBlock& block)
      : transform{RotationOf(block), TranslationOf(block)},
        center(Center(transform)) {}

  RigidTransform transform;
  Vector3d center;
};

// Writes the derivatives by a pose R (x - c), given those by x.
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

// Writes those by the parameters of a camera and returns those by x_cam.
Matrix3d Project(int camera_model, const std::vector<double>& params,
                 const Vector3d& x_cam,
                 const AdjustmentColumns::Camera& columns, Matrix3d* to) {
  const Eigen::Vector2d ray = x_cam.hnormalized();
  const auto num_params = static_cast<int>(params.size());
  double J_params[2 * kMaxCameraParams];  // row by row
  const DifferentiatedPixel projected =
      DifferentiatePixel(camera_model, params.data(), ray,
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
    add(columns.cap);
  }
  begin_.push_back(static_cast<int64_t>(blocks_.size()));
  D_.assign(blocks_.size(), Matrix3d::Zero());
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
    StorePose(frame_columns, *by_point, x - frame.center, by_frame);
  };
  ParallelFor(static_cast<int64_t>(blocks.observations.size()),
              kObservationsPerChunk, num_threads,
              [&](int64_t begin, int64_t end, int) {
                for (int64_t i = begin; i < end; ++i) {
                  evaluate(blocks.observations[i], &D_[begin_[i]]);
                }
              });
}

}  // namespace krot
