#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/analysis/epipolar_match.h"

namespace krot::internal {

// The most matches that one baseline explains.
struct BaselineSearch {
  int64_t num_explained = 0;  // by `baseline`: ErrorPx <= tolerance_px
  // No baseline explains more. Equal to num_explained unless the search ended
  // early.
  int64_t upper_bound = 0;
  Eigen::Vector3d baseline = Eigen::Vector3d::UnitZ();  // of length 1
  int64_t num_cells = 0;                                // that were looked at
};

// Branch and bound over the half sphere of all directions, exact up to
// rounding: each cell of a cube's three faces is given up once no direction in
// it can explain more matches than the best one found, and is divided
// otherwise. Ends early after `max_cells` cells, and at cells that are no
// longer than 1e-12. Same result on every machine. O(cells * matches); a
// thousand matches, half of them wrong, take milliseconds.
//
// Throws std::invalid_argument unless tolerance_px > 0 and max_cells > 0.
BaselineSearch SearchBaseline(const std::vector<EpipolarMatch>& matches,
                              double tolerance_px, int64_t max_cells = 1000000);

}  // namespace krot::internal
