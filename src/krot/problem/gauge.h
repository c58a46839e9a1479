#pragma once

#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/math/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Centres closer than this, relative to the size of their coordinates and of
// the component, coincide: rounding is a thousand times smaller.
inline constexpr double kCoincident = 1e-12;

// Where a frame's camera sits, once for all its views.
struct FrameGeometry {
  Eigen::Matrix3d world_from_rig = Eigen::Matrix3d::Identity();  // R_rw'
  Eigen::Vector3d centre_in_rig = Eigen::Vector3d::Zero();       // -R_sr' t_sr
  int num_views = 0;                                             // that count
  bool is_seen_through = false;  // it has an observation
  bool has_two_centres = false;  // its observations fix the scale
};

// Of every frame; of the whole where ranks share the points. O(observations).
std::vector<FrameGeometry> DescribeFrames(const KnownRotationProblem& problem,
                                          const Context& context);

// The freedom that the known rotation problem leaves: every connected
// component may be translated and, unless a baseline fixes its size, scaled
// about any point.
//
// Frame f moves as a whole: if its projection centre C_f shifts by d, then
// t_f' = t_f - R_rw d. A component's scale is fixed as soon as one of its
// frames sees points through two different projection centres. A component with
// anything fixed keeps its place, and is free to be scaled about that alone,
// if all that is fixed in it coincides.

// The frames that place and scale of their components come from: those that
// have a position in `reference` and keep their place among the others from
// there to `estimate` (krot/geometry/transform.h). What `is_loose` marks, if it
// is not empty, does not count unless all frames of its component are loose.
// 1 or 0 per frame. O(observations).
std::vector<char> FindHeldFrames(const KnownRotationProblem& problem,
                                 const Estimate& reference,
                                 const Estimate& estimate,
                                 const std::vector<char>& is_loose = {},
                                 const Context& context = {});

// Moves `estimate` onto the coordinate frame of `reference`, one component at
// a time, so that the projection centres of its held frames keep the centroid
// that they have in `reference` and, where the scale is free, the RMS distance
// to it. Every view of a frame counts once, with the centre through which its
// frame sees points. Where all these centres coincide (in either estimate), the
// points keep the median of their distances from the centroid instead.
// A component of which nothing is finite in `reference` stays. The cost does
// not change. Frames and points without an observation stay, and so does what
// is fixed, with all of its component but for the scale, if that is free: it is
// that of the RMS distance to what is fixed. An estimate in the right place
// keeps its bits. `held` is FindHeldFrames of the two if it is null.
// O(observations).
void RestoreGauge(const KnownRotationProblem& problem,
                  const Estimate& reference, Estimate* estimate,
                  const Context& context = {},
                  const std::vector<char>* held = nullptr);

// The same, unless it would raise the cost of its own rows, pixels, by more
// than rounding: what is small and near the origin loses its digits elsewhere.
// Then the estimate stays as it is.
void RestoreGaugeIfHarmless(const KnownRotationProblem& problem,
                            const Estimate& reference, Norm norm,
                            const Context& context, Estimate* estimate,
                            const std::vector<char>* held = nullptr);

// Scales an estimate to a median depth of one: that of a problem without
// baselines (HasBaseline), whose scale is free. O(observations).
void NormalizeScale(const KnownRotationProblem& problem, Estimate* estimate);

}  // namespace krot::internal
