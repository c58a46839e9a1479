#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace krot::internal {

// The known rotation problem in pixels [Zhang18, (KRot)], for frames with
// any number of cameras:
//
//   min over t_f, s_k   max_i  ||v_i||_p / w_i    subject to  w_i > 0,
//   (w_i; v_i) = E_i x_cam,   x_cam = R_sr (R_rw s_k + t_f) + t_sr.
//
// w is the depth; the ratio is the reprojection error in pixels, linearised
// where the row E was taken (docs/method/problem.md).

// One image: the pose of its camera in its frame.
struct View {
  Eigen::Matrix3d cam_from_world_rotation;   // R_sr R_rw
  Eigen::Matrix3d cam_from_rig_rotation;     // R_sr
  Eigen::Vector3d cam_from_rig_translation;  // t_sr, scene units
  int32_t frame = 0;
};

// One 2D observation of one point. 80 bytes.
struct Observation {
  // det E > 0. Row 0, the depth's, has length 1; rows 1 and 2 are pixels.
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> E;
  int32_t view = 0;
  int32_t point = 0;
};

// The row of an observation that is taken at the pixel's own ray. u is that ray
// on the plane z = 1, and J = d pixel / d u there, det J > 0.
// E = [e3'; J (I2 | -u)].
Eigen::Matrix3d RowAtRay(const Eigen::Vector2d& u, const Eigen::Matrix2d& J);

// What a loop `for (i : range)` goes through.
template <typename Iterator>
struct Range {
  Iterator first, last;
  Iterator begin() const { return first; }
  Iterator end() const { return last; }
};

struct IndexIterator {
  int64_t index;
  int64_t operator*() const { return index; }
  IndexIterator& operator++() {
    ++index;
    return *this;
  }
  bool operator!=(IndexIterator other) const { return index != other.index; }
};

// The observations are sorted by point; an index lists them by frame.
struct KnownRotationProblem {
  int32_t num_frames = 0;
  int32_t num_points = 0;
  std::vector<View> views;
  std::vector<Observation> observations;
  // Point k's observations: [point_begin[k], point_begin[k + 1]).
  std::vector<int64_t> point_begin;
  // Frame f's observations: observations[frame_observations[n]] for n in
  // [frame_begin[f], frame_begin[f + 1]).
  std::vector<int64_t> frame_begin;
  std::vector<int32_t> frame_observations;
  // Fixed positions: t_f per frame, s_k per point; empty if no frame, or no
  // point, is fixed. Every estimate of the problem must have them.
  std::vector<std::optional<Eigen::Vector3d>> fixed_translations;
  std::vector<std::optional<Eigen::Vector3d>> fixed_points;

  // The indices of point k's observations, and of frame f's; ascending.
  Range<IndexIterator> OfPoint(int64_t k) const {
    return {{point_begin[k]}, {point_begin[k + 1]}};
  }
  Range<const int32_t*> OfFrame(int64_t f) const {
    return {frame_observations.data() + frame_begin[f],
            frame_observations.data() + frame_begin[f + 1]};
  }
  // The frame of observation i.
  int32_t FrameOf(int64_t i) const { return views[observations[i].view].frame; }

  bool IsFixedFrame(int32_t f) const {
    return !fixed_translations.empty() && fixed_translations[f].has_value();
  }
  bool IsFixedPoint(int32_t k) const {
    return !fixed_points.empty() && fixed_points[k].has_value();
  }
};

// The unknowns.
struct Estimate {
  std::vector<Eigen::Vector3d> translations;  // t_f, per frame
  std::vector<Eigen::Vector3d> points;        // s_k
};

// from + share (to - from).
Estimate Between(const Estimate& from, const Estimate& to, double share);

// Builds the indices from views and observations, which must already be
// sorted by point; a frame's observations are listed in that order too.
// Throws std::invalid_argument where an index is out of range or the order is
// broken. O(observations); 4 bytes per observation and 8 per point and frame.
void IndexObservations(KnownRotationProblem* problem);

// Whether any camera is away from its frame's origin, t_sr != 0. If none is,
// and nothing is fixed, the problem is homogeneous. Without baselines the scale
// is free unless two positions are fixed (IsScaleFree). O(views).
bool HasBaseline(const KnownRotationProblem& problem);

// Frames and points for which the problem has a position are fixed. One fixed
// position determines the translation of the whole. Two fixed positions, or a
// baseline, determine the scale (docs/method/positions.md, "What is fixed").

// Whether anything is fixed.
bool HasFixed(const KnownRotationProblem& problem);

// One of the fixed positions: the centre of the first view whose frame is
// fixed, or else the first fixed point. None if nothing is fixed. O(frames +
// views + points).
std::optional<Eigen::Vector3d> FixedOrigin(const KnownRotationProblem& problem);

// The largest distance of a fixed position from FixedOrigin, scene units. 0 if
// all coincide up to rounding, or nothing is fixed.
double FixedExtent(const KnownRotationProblem& problem);

// Whether the cost of a connected problem stays the same if everything that is
// not fixed is scaled, about FixedOrigin if there is one.
bool IsScaleFree(const KnownRotationProblem& problem);

// An estimate with everything that is fixed in its place, and all other points
// and frames' origins at FixedOrigin or, without one, at zero.
Estimate AllAtOrigin(const KnownRotationProblem& problem);

// Gives everything that is fixed exactly its fixed position.
void PutFixed(const KnownRotationProblem& problem, Estimate* estimate);

}  // namespace krot::internal
