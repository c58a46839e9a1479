#include <algorithm>
#include <cmath>
#include <utility>

#include "krot/adjust/precision_system.h"
#include "krot/base/numbers.h"
#include "krot/geometry.h"
#include "krot/geometry/transform.h"
#include "krot/linear/blocks.h"

namespace krot::internal {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
// The columns: translation, in units of the component's size, rotation, and
// scale.
using Similar = Eigen::Matrix<double, 3, 7>;

// Relative to the largest eigenvalue of a Gram matrix: less is rounding.
constexpr double kNothing = 1e-12;

// The small similarities x -> x + unit t + omega x (x - O) + s (x - O) of a
// component, and how they move its parts.
class Motion {
 public:
  Motion(const AdjustmentColumns& columns, const AdjustmentBlocks& blocks,
         const AdjustmentComponent& component)
      : columns_(columns), blocks_(blocks), component_(component) {
    for (const size_t f : component.frames) {
      centers_.push_back(CenterOf(blocks.frames[f]));
      origin_ += centers_.back() / static_cast<double>(component.frames.size());
    }
    double sum = 0;
    for (const Vector3d& center : centers_) {
      sum += (center - origin_).squaredNorm();
    }
    for (const size_t k : component.points) {
      if (sum > 0) break;
      sum = (blocks.points[k] - origin_).squaredNorm();
    }
    unit_ = sum > 0 ? std::sqrt(sum / static_cast<double>(centers_.size())) : 1;
  }

  Similar OfPlace(const Vector3d& x) const {
    Similar rows;
    rows << unit_ * Matrix3d::Identity(), -CrossMatrix(x - origin_),
        x - origin_;
    return rows;
  }
  // R -> R exp(-[omega]), AdjustmentColumns::Pose.
  static Similar OfRotation() {
    Similar rows = Similar::Zero();
    rows.middleCols<3>(3) = -Matrix3d::Identity();
    return rows;
  }
  static Similar OfBaseline(const Vector3d& center_in_rig) {
    Similar rows = Similar::Zero();
    rows.col(6) = center_in_rig;
    return rows;
  }

  // visit(block or kHeld, rows, whether a length) for everything but the points
  // that are held or eliminated.
  template <typename Visit>
  void ForEachBlock(const Visit& visit) const {
    for (size_t n = 0; n < component_.frames.size(); ++n) {
      const AdjustmentColumns::Pose& pose =
          columns_.frames[component_.frames[n]];
      visit(pose.rotation, OfRotation(), false);
      visit(pose.center, OfPlace(centers_[n]), true);
    }
    for (const size_t s : component_.sensors) {
      const AdjustmentColumns::Pose& pose = columns_.sensors[s];
      visit(pose.center, OfBaseline(CenterOf(blocks_.sensors[s])), true);
    }
    for (const size_t k : component_.points) {
      if (columns_.kept_points[k] == AdjustmentColumns::kHeld) continue;
      visit(columns_.kept_points[k], OfPlace(blocks_.points[k]), true);
    }
  }

  // The combinations of the 7 columns that move nothing that is held or has a
  // known position.
  MatrixXd Free() const {
    MatrixXd gram = MatrixXd::Zero(7, 7);
    const auto hold = [&](const Similar& rows, bool is_length) {
      gram += rows.transpose() * rows / (is_length ? unit_ * unit_ : 1);
    };
    ForEachBlock([&](int32_t block, const Similar& rows, bool is_length) {
      if (block == AdjustmentColumns::kHeld) hold(rows, is_length);
    });
    for (const size_t k : component_.points) {
      if (!columns_.point_moves[k]) hold(OfPlace(blocks_.points[k]), true);
    }
    for (const PositionObservation& position : blocks_.positions) {
      const Place& place = position.of;
      const bool is_point = place.point >= 0;
      const std::vector<size_t>& parts =
          is_point ? component_.points : component_.frames;
      const auto part =
          static_cast<size_t>(is_point ? place.point : place.frame);
      if (std::binary_search(parts.begin(), parts.end(), part)) {
        hold(OfPlace(PositionOf(place, blocks_)), true);
      }
    }
    if (component_.has_fixed_scale) gram(6, 6) += 1;
    if (gram.isZero(0)) return MatrixXd::Identity(7, 7);
    const Eigenpairs eigen = EigenpairsOf(gram);
    Index count = 0;
    while (count < 7 && eigen.values[count] <= kNothing * eigen.values[6]) {
      ++count;
    }
    return eigen.vectors.leftCols(count);
  }

  // Adds what the datum holds, for blocks and for points: 7 columns, lengths in
  // units of the component's size.
  void Hold(AdjustmentDatum datum, const std::vector<int32_t>& points,
            MatrixXd* held_blocks, MatrixXd* held_points) const {
    if (datum == AdjustmentDatum::kPoints) {
      for (size_t n = 0; n < points.size(); ++n) {
        held_points->middleRows<3>(static_cast<Index>(3 * n)) =
            OfPlace(blocks_.points[points[n]]) / (unit_ * unit_);
      }
      for (const size_t k : component_.points) {
        if (columns_.kept_points[k] == AdjustmentColumns::kHeld) continue;
        held_blocks->middleRows<3>(3 * columns_.kept_points[k]) =
            OfPlace(blocks_.points[k]) / (unit_ * unit_);
      }
    } else if (datum == AdjustmentDatum::kFirstCamera) {
      HoldFirst(held_blocks);
    } else {
      for (size_t n = 0; n < component_.frames.size(); ++n) {
        const AdjustmentColumns::Pose& pose =
            columns_.frames[component_.frames[n]];
        if (pose.rotation != AdjustmentColumns::kHeld) {
          held_blocks->middleRows<3>(3 * pose.rotation) = OfRotation();
        }
        if (pose.center == AdjustmentColumns::kHeld) continue;
        Similar rows = OfPlace(centers_[n]) / (unit_ * unit_);
        rows.middleCols<3>(3).setZero();
        held_blocks->middleRows<3>(3 * pose.center) = rows;
      }
    }
  }

 private:
  void HoldFirst(MatrixXd* held) const {
    const AdjustmentColumns::Pose& first =
        columns_.frames[component_.frames[0]];
    Vector3d longest = Vector3d::Zero();
    size_t farthest = 0;
    for (size_t n = 1; n < centers_.size(); ++n) {
      const Vector3d base = centers_[n] - centers_[0];
      if (base.squaredNorm() <= longest.squaredNorm()) continue;
      longest = base;
      farthest = n;
    }
    Index coordinate = 0;
    longest.cwiseAbs().maxCoeff(&coordinate);
    const AdjustmentColumns::Pose& other =
        columns_.frames[component_.frames[farthest]];
    for (int c = 0; c < 3; ++c) {
      (*held)(3 * first.center + c, c) = 1 / unit_;
      (*held)(3 * first.rotation + c, 3 + c) = 1;
    }
    if (farthest > 0) (*held)(3 * other.center + coordinate, 6) = 1 / unit_;
  }

  const AdjustmentColumns& columns_;
  const AdjustmentBlocks& blocks_;
  const AdjustmentComponent& component_;
  std::vector<Vector3d> centers_;
  Vector3d origin_ = Vector3d::Zero();
  double unit_ = 1;
};

ComponentGauge GaugeOf(const AdjustmentColumns& columns,
                       const AdjustmentBlocks& blocks,
                       const AdjustmentComponent& component,
                       AdjustmentDatum datum) {
  ComponentGauge gauge;
  const Motion motion(columns, blocks, component);
  const MatrixXd free = motion.Free();
  if (free.cols() == 0) return gauge;
  MatrixXd similar = MatrixXd::Zero(3 * Index{columns.num_blocks}, 7);
  motion.ForEachBlock([&](int32_t block, const Similar& rows, bool) {
    if (block != AdjustmentColumns::kHeld)
      similar.middleRows<3>(3 * block) = rows;
  });
  // A motion that moves points alone is no gauge: these points are not
  // determined.
  MatrixXd moves = similar * free;
  const Eigenpairs eigen = EigenpairsOf(moves.transpose() * moves);
  Index none = 0;
  while (none < free.cols() &&
         eigen.values[none] <= kNothing * eigen.values[free.cols() - 1]) {
    ++none;
  }
  const bool is_whole = none == 0 && free.cols() == 7;
  const MatrixXd basis =
      is_whole ? free : free * eigen.vectors.rightCols(free.cols() - none);
  gauge.blocks = similar * basis;
  for (const size_t k : component.points) {
    if (columns.IsEliminated(static_cast<int64_t>(k))) {
      gauge.points.push_back(static_cast<int32_t>(k));
    }
  }
  gauge.of_points.resize(3 * static_cast<Index>(gauge.points.size()),
                         basis.cols());
  for (size_t n = 0; n < gauge.points.size(); ++n) {
    gauge.of_points.middleRows<3>(static_cast<Index>(3 * n)) =
        motion.OfPlace(blocks.points[gauge.points[n]]) * basis;
  }

  if (datum == AdjustmentDatum::kFirstCamera && !is_whole) {
    datum = AdjustmentDatum::kCameras;
  }
  // Where cameras or points alone do not hold all motions, both do.
  MatrixXd held_blocks = MatrixXd::Zero(similar.rows(), 7);
  MatrixXd held_points = MatrixXd::Zero(gauge.of_points.rows(), 7);
  for (const AdjustmentDatum more :
       {datum, datum == AdjustmentDatum::kPoints ? AdjustmentDatum::kCameras
                                                 : AdjustmentDatum::kPoints}) {
    motion.Hold(more, gauge.points, &held_blocks, &held_points);
    gauge.held_blocks = held_blocks * basis;
    gauge.held_points = held_points * basis;
    const MatrixXd held = gauge.held_blocks.transpose() * gauge.blocks +
                          gauge.held_points.transpose() * gauge.of_points;
    if (InverseOf(held).rcond > kNothing) break;
  }
  return gauge;
}

}  // namespace

std::vector<ComponentGauge> FindGauges(const BundleAdjustmentOptions& options,
                                       const AdjustmentColumns& columns,
                                       const AdjustmentBlocks& blocks,
                                       AdjustmentDatum datum) {
  std::vector<ComponentGauge> gauges;
  for (const AdjustmentComponent& component :
       FindComponents(blocks, options.refine_sensor_from_rig)) {
    ComponentGauge gauge = GaugeOf(columns, blocks, component, datum);
    if (gauge.size() > 0) gauges.push_back(std::move(gauge));
  }
  return gauges;
}

namespace {

struct CenterStatistics {
  Vector3d centroid = Vector3d::Zero();
  double rms = 0;  // distance to the centroid
};

CenterStatistics Summarize(const std::vector<PoseBlock>& frames,
                           const std::vector<size_t>& indices) {
  CenterStatistics statistics;
  const double count = static_cast<double>(indices.size());
  for (const size_t f : indices) {
    statistics.centroid += CenterOf(frames[f]) / count;
  }
  for (const size_t f : indices) {
    statistics.rms +=
        (CenterOf(frames[f]) - statistics.centroid).squaredNorm() / count;
  }
  statistics.rms = std::sqrt(statistics.rms);
  return statistics;
}

// The rotation nearest to the sum of R_before^T R_after; the identity if
// several are.
Matrix3d MeanRotation(const std::vector<PoseBlock>& before,
                      const std::vector<PoseBlock>& after,
                      const std::vector<size_t>& indices) {
  Matrix3d sum = Matrix3d::Zero();
  for (const size_t f : indices) {
    sum += RotationOf(before[f]).transpose() * RotationOf(after[f]);
  }
  return NearestRotation(sum).value_or(Matrix3d::Identity());
}

// The frames of a component that keep their place among the others, once the
// world has turned.
std::vector<size_t> HeldFrames(const AdjustmentBlocks& before,
                               const AdjustmentBlocks& after,
                               const std::vector<double>& distances_before,
                               const std::vector<double>& distances_after,
                               const AdjustmentComponent& component,
                               const Matrix3d& rotation) {
  std::vector<CameraMove> cameras;
  for (const size_t f : component.frames) {
    cameras.push_back({CenterOf(before.frames[f]),
                       rotation * CenterOf(after.frames[f]),
                       distances_before[f], distances_after[f]});
  }
  const std::vector<char> keeps =
      FindConsensus(cameras, !component.has_fixed_scale);
  std::vector<size_t> held;
  for (size_t n = 0; n < keeps.size(); ++n) {
    if (keeps[n] != 0) held.push_back(component.frames[n]);
  }
  return held;
}

// Moves the frame's centre to `center`, and turns the frame with the world
// unless `keep_rotation`.
void MoveFrame(const Vector3d& center, const Matrix3d& world_rotation,
               bool keep_rotation, PoseBlock* frame) {
  Pose pose = ToPose(*frame);
  if (!keep_rotation) {
    pose.quaternion_wxyz = ToWxyz(
        Eigen::Quaterniond(RotationOf(*frame) * world_rotation.transpose()));
  }
  pose.translation = -(pose.Rotation() * center);
  const PoseBlock moved = ToBlock(pose);
  std::copy(moved.begin() + (keep_rotation ? 4 : 0), moved.end(),
            frame->begin() + (keep_rotation ? 4 : 0));
}

}  // namespace

std::vector<double> TypicalDistances(
    const AdjustmentBlocks& blocks,
    const std::vector<AdjustmentObservation>& of) {
  std::vector<double> distances;
  std::vector<int32_t> frame_of;
  for (const AdjustmentObservation& observation : of) {
    distances.push_back((blocks.points[observation.point] -
                         CenterOf(blocks.frames[observation.frame]))
                            .norm());
    frame_of.push_back(observation.frame);
  }
  return GroupMedians(distances, frame_of,
                      static_cast<int32_t>(blocks.frames.size()), {});
}

void RestoreSimilarity(const BundleAdjustmentOptions& options,
                       const AdjustmentBlocks& before,
                       AdjustmentBlocks* after) {
  if (!options.refine_rig_from_world || !options.refine_points3D) return;
  const bool keep_rotation = options.constant_rig_from_world_rotation;
  const std::vector<double> distances_before =
      TypicalDistances(before, before.observations);
  const std::vector<double> distances_after =
      TypicalDistances(*after, before.observations);
  for (const AdjustmentComponent& component :
       FindComponents(before, options.refine_sensor_from_rig)) {
    if (component.is_held) continue;
    const auto rotation_of =
        [&](const std::vector<size_t>& frames) -> Matrix3d {
      return keep_rotation ? Matrix3d::Identity()
                           : MeanRotation(before.frames, after->frames, frames);
    };
    const std::vector<size_t> held =
        HeldFrames(before, *after, distances_before, distances_after, component,
                   rotation_of(component.frames));
    const CenterStatistics old_centers = Summarize(before.frames, held);
    const CenterStatistics new_centers = Summarize(after->frames, held);
    // Applies to coordinates relative to the new centroid.
    Similarity similarity;
    similarity.translation = old_centers.centroid;
    if (!component.has_fixed_scale && old_centers.rms > 0 &&
        new_centers.rms > 0) {
      similarity.scale = old_centers.rms / new_centers.rms;
    }
    similarity.rotation = rotation_of(held);
    const auto move = [&](const Vector3d& x) -> Vector3d {
      return similarity * (x - new_centers.centroid);
    };
    for (const size_t f : component.frames) {
      MoveFrame(move(CenterOf(after->frames[f])), similarity.rotation,
                keep_rotation, &after->frames[f]);
    }
    for (const size_t s : component.sensors) {
      Eigen::Map<Vector3d>(after->sensors[s].data() + 4) *= similarity.scale;
    }
    for (const size_t k : component.points) {
      after->points[k] = move(after->points[k]);
    }
  }
}

}  // namespace krot::internal
