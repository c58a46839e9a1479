#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "krot/math/simplex_qp.h"

namespace krot {

// The unit vector along the centre of the minimum enclosing ball of the
// descent normals [Zhang18, Alg. 3]; none if the centre is within
// `stationarity_tolerance` (eps_0) of the origin or there are no normals. Up
// to four normals by the closed form, more by their point of least norm,
// which is the same; `scratch` keeps its memory between calls.
std::optional<Eigen::Vector3d> FindDescentDirection(
    const std::vector<Eigen::Vector3d>& descent_normals,
    double stationarity_tolerance, std::vector<LinearPiece>* scratch);

}  // namespace krot
