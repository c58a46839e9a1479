#include "tests/oracle/lp_oracle.h"

#ifdef KROT_HAS_CLP

#include <vector>

#include <ClpSimplex.hpp>
#include <CoinPackedMatrix.hpp>
#include <CoinPackedVector.hpp>

namespace krot {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kTolerance = 1e-9;  // of CLP, pixels times scene units
constexpr double kShare = 1e-8;      // where bisection ends, of gamma

std::vector<Vector2d> DualVertices(Norm norm) {
  if (norm.p == 1) return {{1, 1}, {1, -1}, {-1, 1}, {-1, -1}};
  return {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
}

// Whether all residuals can be gamma or less.
class Feasibility {
 public:
  Feasibility(const KnownRotationProblem& problem, Norm norm, double min_depth)
      : problem_(problem),
        vertices_(DualVertices(norm)),
        min_depth_(min_depth) {}

  bool operator()(double gamma) const {
    const int tau = 3 * (problem_.num_points + problem_.num_frames);
    CoinPackedMatrix matrix(/*colordered=*/false, 0, 0);
    matrix.setDimensions(0, tau + 1);
    std::vector<double> row_lower;
    for (const Observation& o : problem_.observations) {
      const View& view = problem_.views[o.view];
      // Row a'x >= b - slack tau, from a' x_cam >= b.
      const auto add = [&](const Vector3d& a, double b, double slack) {
        CoinPackedVector row;
        const Vector3d of_point = view.cam_from_world_rotation.transpose() * a;
        const Vector3d of_frame = view.cam_from_rig_rotation.transpose() * a;
        for (int k = 0; k < 3; ++k) {
          row.insert(3 * o.point + k, of_point[k]);
          row.insert(3 * (problem_.num_points + view.frame) + k, of_frame[k]);
        }
        if (slack != 0) row.insert(tau, slack);
        matrix.appendRow(row);
        row_lower.push_back(b - a.dot(view.cam_from_rig_translation));
      };
      add(o.E.row(0).transpose(), min_depth_, 0);
      for (const Vector2d& h : vertices_) {
        add(o.E.transpose() * Vector3d(gamma, -h[0], -h[1]), 0, 1);
      }
    }
    std::vector<double> lower(tau + 1, -COIN_DBL_MAX);
    std::vector<double> upper(tau + 1, COIN_DBL_MAX);
    lower[tau] = 0;
    for (int k = 0; k < 3; ++k) {  // the first frame stays at the origin
      lower[3 * problem_.num_points + k] = upper[3 * problem_.num_points + k] =
          0;
    }
    std::vector<double> objective(tau + 1, 0.0);
    objective[tau] = 1;
    ClpSimplex model;
    model.setLogLevel(0);
    model.setPrimalTolerance(kTolerance);
    model.setDualTolerance(kTolerance);
    model.loadProblem(matrix, lower.data(), upper.data(), objective.data(),
                      row_lower.data(), nullptr);
    model.dual();
    return model.isProvenOptimal() && model.objectiveValue() <= 10 * kTolerance;
  }

 private:
  const KnownRotationProblem& problem_;
  const std::vector<Vector2d> vertices_;
  const double min_depth_;
};

}  // namespace

std::optional<double> OptimalCostByBisection(
    const KnownRotationProblem& problem, Norm norm, double upper_bound,
    double min_depth) {
  const Feasibility is_feasible(problem, norm, min_depth);
  double infeasible = 0;
  double feasible = upper_bound;
  while (feasible - infeasible > kShare * feasible) {
    const double gamma = (infeasible + feasible) / 2;
    (is_feasible(gamma) ? feasible : infeasible) = gamma;
  }
  return feasible;
}

}  // namespace krot

#else

namespace krot {

std::optional<double> OptimalCostByBisection(const KnownRotationProblem&, Norm,
                                             double, double) {
  return std::nullopt;
}

}  // namespace krot

#endif
