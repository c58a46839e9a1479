#include "krot/model/local_frame.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "krot/base/numbers.h"
#include "krot/model/id_index.h"
#include "krot/model/image_geometry.h"

namespace krot::internal {
namespace {

using Eigen::Vector3d;
using Real = long double;

// From here on coordinates cost digits, and adjustments steps: to turn a camera
// about the origin, a hundred extents away, takes four times as many.
constexpr double kFarOut = 10;

// By coordinate; none without positions.
std::optional<Vector3d> MedianPosition(const std::vector<Vector3d>& positions) {
  if (positions.empty()) return std::nullopt;
  Vector3d median;
  std::vector<double> values(positions.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t n = 0; n < values.size(); ++n) values[n] = positions[n][axis];
    median[axis] = Median(values);
  }
  return median;
}

double MedianDistance(const std::vector<Vector3d>& positions,
                      const Vector3d& from) {
  std::vector<double> distances;
  for (const Vector3d& x : positions) distances.push_back((x - from).norm());
  return distances.empty() ? 0 : Median(std::move(distances));
}

// Of the frames' rigs.
std::vector<Vector3d> Centres(const Model& model,
                              const std::vector<char>& is_wanted) {
  std::vector<Vector3d> centres;
  for (size_t f = 0; f < model.frames.size(); ++f) {
    const RigidTransform rig_from_world =
        model.frames[f].rig_from_world.Transform();
    if (!rig_from_world.translation.allFinite() ||
        !rig_from_world.rotation.allFinite()) {
      continue;
    }
    if (!is_wanted.empty() && !is_wanted[f]) continue;
    centres.push_back(Center(rig_from_world));
  }
  return centres;
}

std::vector<Vector3d> Points(const Model& model,
                             const std::vector<char>& is_wanted) {
  std::vector<Vector3d> points;
  for (size_t k = 0; k < model.points3D.size(); ++k) {
    if (is_wanted.empty() || is_wanted[k]) {
      points.push_back(model.points3D[k].xyz);
    }
  }
  return points;
}

std::vector<Vector3d> Positions(const Model& model, const FixedParts& fixed,
                                const std::vector<KnownPosition>& known) {
  std::vector<Vector3d> positions;
  if (!fixed.frames.empty()) positions = Centres(model, fixed.frames);
  if (!fixed.points3D.empty()) {
    const std::vector<Vector3d> points = Points(model, fixed.points3D);
    positions.insert(positions.end(), points.begin(), points.end());
  }
  for (const KnownPosition& position : known) {
    positions.push_back(position.region.centre);
  }
  if (positions.empty()) positions = Centres(model, {});
  if (positions.empty()) positions = Points(model, {});
  return positions;
}

// t + R `shift`, rounded once; without a rotation there is nothing to shift.
void Shift(const Vector3d& shift, Pose* pose) {
  if (!HasRotation(pose->quaternion_wxyz)) return;
  pose->translation = (pose->translation.cast<Real>() +
                       pose->Rotation().cast<Real>() * shift.cast<Real>())
                          .cast<double>();
}

bool IsSame(const Pose& a, const Pose& b) {
  return a.quaternion_wxyz == b.quaternion_wxyz &&
         (a.translation == b.translation || !b.translation.allFinite());
}

// `pose` is what became of `was`.Shift(origin).
void ShiftBack(const Vector3d& origin, const Pose& was, Pose* pose) {
  Pose local = was;
  Shift(origin, &local);
  if (IsSame(local, *pose)) {
    *pose = was;
  } else {
    Shift(-origin, pose);
  }
}

}  // namespace

LocalFrame::LocalFrame(const Model& model, const FixedParts& fixed,
                       const std::vector<KnownPosition>& known) {
  const std::vector<Vector3d> positions = Positions(model, fixed, known);
  const std::optional<Vector3d> middle = MedianPosition(positions);
  if (!middle) return;
  double extent = MedianDistance(positions, *middle);
  if (extent == 0) extent = MedianDistance(Points(model, {}), *middle);
  if (!(extent > 0) || !(middle->norm() > kFarOut * extent)) return;
  // To a power of two beyond the extent: differences to it are exact.
  const double unit = std::exp2(std::ceil(std::log2(extent)));
  origin_ = (*middle / unit).array().round() * unit;
}

Model LocalFrame::ToLocal(const Model& model) const {
  Model local = model;
  if (IsModels()) return local;
  for (Frame& frame : local.frames) Shift(origin_, &frame.rig_from_world);
  for (Image& image : local.images) Shift(origin_, &image.cam_from_world);
  for (Point3D& point : local.points3D) point.xyz -= origin_;
  return local;
}

std::vector<KnownPosition> LocalFrame::ToLocal(
    std::vector<KnownPosition> known) const {
  for (KnownPosition& position : known) position.region.centre -= origin_;
  return known;
}

Model LocalFrame::FromLocal(const Model& before, const Model& local) const {
  Model model = local;
  if (IsModels()) return model;
  for (size_t f = 0; f < model.frames.size(); ++f) {
    ShiftBack(origin_, before.frames[f].rig_from_world,
              &model.frames[f].rig_from_world);
  }
  for (size_t n = 0; n < model.images.size(); ++n) {
    ShiftBack(origin_, before.images[n].cam_from_world,
              &model.images[n].cam_from_world);
  }
  const IdIndex<Point3DId> index(before.points3D);
  for (Point3D& point : model.points3D) {
    const std::optional<int32_t> k = index.Find(point.id);
    const bool stays = k && before.points3D[*k].xyz - origin_ == point.xyz;
    point.xyz = stays ? before.points3D[*k].xyz : point.xyz + origin_;
  }
  return model;
}

}  // namespace krot::internal
