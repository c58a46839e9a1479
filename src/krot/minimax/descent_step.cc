#include "krot/minimax/descent_step.h"

#include <algorithm>
#include <limits>

#include "krot/minimax.h"

namespace krot::internal {
void FindDescentNormals(const ResidualSet& residuals, const Eigen::Vector3d& x,
                        Norm norm, double active_tolerance,
                        std::vector<Eigen::Vector3d>* descent_normals) {
  descent_normals->clear();
  const double* values = residuals.values();
  const double cost = *std::max_element(values, values + residuals.size());
  const double share = 1 - active_tolerance;
  for (int i = 0; i < residuals.size(); ++i) {
    if (values[i] < share * cost) continue;  // (5)
    ResidualPiece pieces[kMaxPieces];
    const int count = ResidualPieces(residuals[i], x, norm, share, pieces);
    for (int k = 0; k < count; ++k) {
      const double length = pieces[k].gradient.norm();
      if (!(length > 0)) continue;
      descent_normals->push_back(-pieces[k].gradient / length);  // (6)
    }
  }
}

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

namespace {

// f(alpha) = max_i r_i(alpha)  [Zhang18, Alg. 4, line 2]
double Evaluate(const std::vector<LineResidual>& line, double alpha,
                Norm norm) {
  double largest = 0;
  for (const LineResidual& r : line) {
    const double depth = r.w * alpha + r.z;
    if (!(depth > 0)) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, NormOf(r.u * alpha + r.v, norm) / depth);
  }
  return largest;
}

}  // namespace

double FindStepSize(const ResidualSet& residuals, const Eigen::Vector3d& x,
                    const Eigen::Vector3d& direction, Norm norm,
                    const StepSizeOptions& options,
                    std::vector<LineResidual>* scratch) {
  std::vector<LineResidual>& line = *scratch;
  line.clear();
  double lb = 0;
  double ub = options.max_step;
  for (int i = 0; i < residuals.size(); ++i) {
    const Residual r = residuals[i];
    line.push_back(
        {r.A * direction, r.Numerator(x), r.c.dot(direction), r.Depth(x)});
    // The supremum of alpha with w alpha + z > 0 (Sec. 3.2).
    if (line.back().w < 0) ub = std::min(ub, -line.back().z / line.back().w);
  }
  while (ub - lb > options.step_tolerance) {
    const double alpha = (ub + lb) / 2;
    const double r_left = Evaluate(line, alpha - options.slope_probe, norm);
    const double r = Evaluate(line, alpha, norm);
    const double r_right = Evaluate(line, alpha + options.slope_probe, norm);
    if (r_left > r && r > r_right) {
      lb = alpha;  // on the decreasing part of f
    } else if (r_left < r && r < r_right) {
      ub = alpha;  // on the increasing part of f
    } else {
      break;  // stationary up to the probe
    }
  }
  return (ub + lb) / 2;
}

}  // namespace krot::internal
