#include "krot/minimax/descent_direction.h"

#include "krot/math/min_enclosing_ball.h"

namespace krot {

std::optional<Eigen::Vector3d> FindDescentDirection(
    const std::vector<Eigen::Vector3d>& descent_normals,
    double stationarity_tolerance, std::vector<LinearPiece>* scratch) {
  const int count = static_cast<int>(descent_normals.size());
  if (count == 0) return std::nullopt;
  const Eigen::Vector3d center =  // (7)
      count <= 4 ? MinEnclosingBall(descent_normals.data(), count).center
                 : MinNormPoint(descent_normals.data(), count, scratch);
  const double length = center.norm();
  if (!(length > stationarity_tolerance)) return std::nullopt;
  return center / length;
}

}  // namespace krot
