#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/base/numbers.h"
#include "krot/geometry.h"
#include "krot/minimax/kernels.h"
#include "krot/minimax/residual_set.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot::internal {

// Rounding may raise an error by this, relative.
inline constexpr double kErrorRounding = 1e-9;

// The map x -> R x + o as the matrix [R o].
using AffineMap = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

// Maps world coordinates to those of a view's camera, if its frame has this
// translation: R = R_sr R_rw, o = R_sr t_f + t_sr.
inline AffineMap CamFromWorld(const View& view,
                              const Eigen::Vector3d& translation) {
  AffineMap map;
  map.leftCols<3>() = view.cam_from_world_rotation;
  map.col(3) =
      view.cam_from_rig_rotation * translation + view.cam_from_rig_translation;
  return map;
}

// The same for every view.
inline std::vector<AffineMap> CamerasFromWorld(
    const KnownRotationProblem& problem,
    const std::vector<Eigen::Vector3d>& translations) {
  std::vector<AffineMap> cameras;
  cameras.reserve(problem.views.size());
  for (const View& view : problem.views) {
    cameras.push_back(CamFromWorld(view, translations[view.frame]));
  }
  return cameras;
}

inline Eigen::Vector3d InCamera(const AffineMap& camera,
                                const Eigen::Vector3d& point) {
  return camera.leftCols<3>() * point + camera.col(3);
}

// The camera's centre in the world.
inline Eigen::Vector3d CentreOf(const AffineMap& camera) {
  return -camera.leftCols<3>().transpose() * camera.col(3);
}

// The depth w and the v of an observation's residual ||v||_p / w.
struct ViewedPoint {
  double depth;       // w, scene units
  Eigen::Vector2d v;  // pixels times scene units
};

inline ViewedPoint ViewPoint(const AffineMap& camera,
                             const Observation& observation,
                             const Eigen::Vector3d& point) {
  const Eigen::Vector3d wv = observation.E * InCamera(camera, point);
  return {wv[0], wv.tail<2>()};
}
ViewedPoint ViewPoint(const KnownRotationProblem& problem,
                      const Observation& observation, const Estimate& estimate);

// r = ||v||_p / w in pixels; infinity unless w > 0 and r is finite.
inline double ResidualOf(const ViewedPoint& viewed, Norm norm) {
  if (!(viewed.depth > 0)) return kInfinity;
  const double residual = NormOf(viewed.v, norm) / viewed.depth;
  return residual < kInfinity ? residual : kInfinity;
}

// Whether every observation has a depth w > 0: the cost is finite only then.
bool AllDepthsPositive(const KnownRotationProblem& problem,
                       const Estimate& estimate, int num_threads);

// The median of the depths of all observations, scene units. Requires at least
// one observation. O(observations).
double MedianDepth(const KnownRotationProblem& problem,
                   const Estimate& estimate);

// The first residual above `level` of observations [begin, end), or the largest
// residual if none is above it; pixels.
double ResidualAbove(double level, const KnownRotationProblem& problem,
                     const std::vector<AffineMap>& cameras,
                     const std::vector<Eigen::Vector3d>& points, Norm norm,
                     int64_t begin, int64_t end);

// The largest residual of some observations, pixels, as of OfPoint or OfFrame;
// 0 if there are none.
template <typename Indices>
double CostOf(const KnownRotationProblem& problem, const Estimate& estimate,
              Norm norm, const Indices& observations) {
  double cost = 0;
  for (const int64_t i : observations) {
    cost = std::max(
        cost, ResidualOf(ViewPoint(problem, problem.observations[i], estimate),
                         norm));
  }
  return cost;
}

// max_i r_i in pixels [Zhang18, (KRot)]; 0 if there are no observations.
// Throws std::invalid_argument unless p >= 1 and the estimate has one
// translation per frame and one point per point. O(observations); the result
// has the same bits at any number of threads.
double Cost(const KnownRotationProblem& problem, const Estimate& estimate,
            Norm norm, int num_threads);

// Whether a cost, pixels, may be the rounding error of residuals that are 0.
inline bool IsZeroUpToRounding(double cost) { return cost < 1e-9; }

// One observation as a residual of problem (1) of [Zhang18]. In the unknown x,
// a point or a frame's translation with the other one held fixed, its
//
//   v = A x + b,   w = c'x + d                              [Zhang18, (2), (3)]
//
// are affine. With x_cam = R x + o,
//
//   (c'; A) = E R,   (d; b) = E o.
//
// In the layout of kernels.h:
//   {A11, A12, A13, b1, A21, A22, A23, b2, c1, c2, c3, d}.

// For Int_k: the unknown is the point s; R = R_sr R_rw, o = R_sr t_f + t_sr, so
// that `map` is the view's CamFromWorld.
inline void AffineRow(const AffineMap& map, const Observation& observation,
                      double row[kResidualRow]) {
  const auto& E = observation.E;
  for (int k = 0; k < 4; ++k) {  // columns: of x and of 1
    const auto component = [&](int r) {
      return E(r, 0) * map(0, k) + E(r, 1) * map(1, k) + E(r, 2) * map(2, k);
    };
    row[k] = component(1);
    row[4 + k] = component(2);
    row[8 + k] = component(0);
  }
}

// For Res_j: the unknown is the frame's translation t_f, with the point s fixed
// at `point`; R = R_sr, o = R_sr R_rw s + t_sr.
inline void ResectionRow(const View& view, const Observation& observation,
                         const Eigen::Vector3d& point,
                         double row[kResidualRow]) {
  AffineMap map;
  map.leftCols<3>() = view.cam_from_rig_rotation;
  map.col(3) =
      view.cam_from_world_rotation * point + view.cam_from_rig_translation;
  AffineRow(map, observation, row);
}

// Whether R_sr = I, as of a frame's reference sensor.
inline bool IsReference(const View& view) {
  return view.cam_from_rig_rotation == Eigen::Matrix3d::Identity();
}

// ResectionRow of a view with R_sr = I, where A and c are the rows of E. It
// takes 18 products instead of 45.
inline void ReferenceResectionRow(const View& view,
                                  const Observation& observation,
                                  const Eigen::Vector3d& point,
                                  double row[kResidualRow]) {
  const auto& E = observation.E;
  const Eigen::Vector3d o =
      view.cam_from_world_rotation * point + view.cam_from_rig_translation;
  const auto write = [&](int r, double* out) {
    for (int k = 0; k < 3; ++k) out[k] = E(r, k);
    out[3] = E(r, 0) * o[0] + E(r, 1) * o[1] + E(r, 2) * o[2];
  };
  write(1, row);
  write(2, row + 4);
  write(0, row + 8);
}

}  // namespace krot::internal
