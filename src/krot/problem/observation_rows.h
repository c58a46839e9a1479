#pragma once

#include <Eigen/Core>

#include "krot/minimax/residual_kernel.h"
#include "krot/problem/cameras.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// One observation as a residual of problem (1) of [Zhang18]: in the unknown x
// (a point or a frame's translation, the other one held fixed) its
//
//   v = A x + b,   w = c'x + d                              [Zhang18, (2), (3)]
//
// are affine. With x_cam = R x + o,
//
//   (c'; A) = E R,   (d; b) = E o.
//
// In the layout of residual_kernel.h:
//   {A11, A12, A13, b1, A21, A22, A23, b2, c1, c2, c3, d}.

namespace internal {

inline void AffineRow(const Observation& observation, const AffineMap& map,
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

}  // namespace internal

// Int_k: the unknown is the point s; R = R_sr R_rw, o = R_sr t_f + t_sr.
inline void IntersectionRow(const AffineMap& cam_from_world,
                            const Observation& observation,
                            double row[kResidualRow]) {
  internal::AffineRow(observation, cam_from_world, row);
}

// Res_j: the unknown is the frame's translation t_f, its point at `point`;
// R = R_sr, o = R_sr R_rw s + t_sr.
inline void ResectionRow(const View& view, const Observation& observation,
                         const Eigen::Vector3d& point,
                         double row[kResidualRow]) {
  AffineMap map;
  map.leftCols<3>() = view.cam_from_rig_rotation;
  map.col(3) =
      view.cam_from_world_rotation * point + view.cam_from_rig_translation;
  internal::AffineRow(observation, map, row);
}

// Whether R_sr = I: the view's camera is its frame's own.
inline bool IsReference(const View& view) {
  return view.cam_from_rig_rotation == Eigen::Matrix3d::Identity();
}

// ResectionRow of a view with R_sr = I, by 18 products instead of 45: A and c
// are E's rows.
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

}  // namespace krot
