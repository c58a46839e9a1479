#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include <Eigen/Core>

#include "krot/base/context.h"
#include "krot/geometry.h"
#include "krot/linear/blocks.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// The freedom that the known rotation problem leaves: every connected
// component may be translated and, unless a baseline fixes its size, scaled
// about any point.
//
// Frame f moves as a whole: if its projection centre C_f shifts by d, then
// t_f' = t_f - R_rw d. A component's scale is fixed as soon as one of its
// frames sees points through two different projection centres. A component with
// anything fixed cannot be translated. It may be scaled only if all fixed
// positions in it coincide, and only about these.

// The held frames, which determine the place and scale of their components:
// those that have a position in `reference` and keep their place among the
// others between `reference` and `estimate` (FindConsensus,
// krot/geometry/transform.h). Frames marked by `is_loose`, if that is not
// empty, are not held unless all frames of their component are loose. Returns 1
// or 0 per frame. O(observations).
std::vector<char> FindHeldFrames(const KnownRotationProblem& problem,
                                 const Estimate& reference,
                                 const Estimate& estimate,
                                 const std::vector<char>& is_loose = {},
                                 const Context& context = {});

// Moves `estimate` into the coordinate frame of `reference`, one component at
// a time, so that the projection centres of its held frames have the same
// centroid as in `reference` and, where the scale is free, the same RMS
// distance to it. A frame's centre counts once for each of its views. Where all
// centres coincide (in either estimate), the median distance of the points from
// the centroid takes the place of the RMS distance. A component of which
// nothing is finite in `reference` stays. The cost does not change.
//
// Frames and points without an observation stay, and so does what is fixed. A
// component with something fixed is only scaled, if its scale is free: then the
// RMS distance from the fixed position becomes that of `reference`. An estimate
// in the right place keeps its bits. If `held` is null, FindHeldFrames is used.
// O(observations).
void RestoreGauge(const KnownRotationProblem& problem,
                  const Estimate& reference, Estimate* estimate,
                  const Context& context = {},
                  const std::vector<char>* held = nullptr);

// The same, unless it would raise the cost of the problem's rows by more than
// rounding; then the estimate stays as it is. That happens because coordinates
// lose digits when something small is moved away from the origin.
void RestoreGaugeIfHarmless(const KnownRotationProblem& problem,
                            const Estimate& reference, Norm norm,
                            const Context& context, Estimate* estimate,
                            const std::vector<char>* held = nullptr);

// Where something of a frame, or else a point, is to be: |U (x - g)| <= 1.
struct WantedPlace {
  int32_t frame = -1;
  int32_t point = -1;  // if frame is -1
  Eigen::Vector3d x;
  Eigen::Vector3d centre;           // g
  Eigen::Matrix3d unit_from_world;  // U
};

// Moves each component in which nothing is fixed, and scales it if its scale is
// free, so that the largest |U (x - g)| of its places becomes nearly the least,
// by reweighted least squares [Lawson 1961]. Does not raise it. The cost does
// not change. O(observations + places).
void MoveToPlaces(const KnownRotationProblem& problem,
                  const std::vector<WantedPlace>& places, Estimate* estimate);

// Scales an estimate to a median depth of one. The problem must have no
// baselines (HasBaseline), so that its scale is free. O(observations).
void NormalizeScale(const KnownRotationProblem& problem, Estimate* estimate);

// Centres closer than this, relative to the size of their coordinates and of
// the component, coincide: rounding is a thousand times smaller.
inline constexpr double kCoincident = 1e-12;

// The projection centre of a frame: that of its first view with an observation.
struct FrameGeometry {
  Eigen::Matrix3d world_from_rig = Eigen::Matrix3d::Identity();  // R_rw'
  Eigen::Vector3d centre_in_rig = Eigen::Vector3d::Zero();       // -R_sr' t_sr
  int num_views = 0;                                             // its weight
  bool is_seen_through = false;  // it has an observation
  bool has_two_centres = false;  // its observations fix the scale
};

// Describes every frame; from the observations of all ranks where ranks share
// the points. O(observations).
std::vector<FrameGeometry> DescribeFrames(const KnownRotationProblem& problem,
                                          const Context& context);

// The unknowns of the linear systems of the known rotation problem: the points
// s_k and the frames' centres in the world, C_f = -R_rw' t_f. As
//
//   x_cam = R_sr (R_rw s + t_f) + t_sr = R_cw (s - C_f) + t_sr,
//
// a row depends only on the difference between its point and its frame's
// centre.

// The structure of the linear systems. Held fixed are: everything that the
// problem fixes; in each connected component without anything fixed, the frame
// with the most observations; and frames without observations. Where ranks
// share the points, components and counts are those of the whole problem.
BlockStructure AnchoredStructure(const KnownRotationProblem& problem,
                                 const Context& context = {});

// R_rw of each frame; the identity for a frame without views.
std::vector<Eigen::Matrix3d> RigFromWorldRotations(
    const KnownRotationProblem& problem);

// The centre of each frame.
std::vector<Eigen::Vector3d> CentresOf(
    const std::vector<Eigen::Matrix3d>& rig_from_world,
    const std::vector<Eigen::Vector3d>& translations);

// Sets `to` to `from`, moved by `step` along a direction of points and centres.
// `to` may be `from`.
void MoveCentres(const std::vector<Eigen::Matrix3d>& rig_from_world,
                 const Estimate& from, double step,
                 const BlockVector& direction, Estimate* to);

// The gradient of sum_i multiplier(i)'(w_i; v_i), where w_i is the depth and
// v_i the v of observation i, with respect to all points and to the centres
// that the structure does not fix.
BlockVector GradientOf(
    const KnownRotationProblem& problem, const BlockStructure& structure,
    const std::function<Eigen::Vector3d(int64_t i)>& multiplier);

}  // namespace krot::internal
