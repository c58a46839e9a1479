#include "tests/oracle/lp_oracle.h"

#ifdef KROT_HAS_CLP

#include <limits>
#include <vector>

#include <ClpSimplex.hpp>
#include <CoinPackedMatrix.hpp>
#include <CoinPackedVector.hpp>

namespace krot::internal {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kTolerance = 1e-9;  // of CLP, pixels times scene units
constexpr double kShare = 1e-8;      // where bisection ends, of gamma

std::vector<Vector2d> DualVertices(Norm norm) {
  if (norm.p == 1) return {{1, 1}, {1, -1}, {-1, 1}, {-1, -1}};
  return {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
}

// Rows a'x >= lower that say of every residual that it is at most gamma, with
// `slack` as one more column if wanted.
struct ResidualRows {
  ResidualRows(const KnownRotationProblem& problem, Norm norm, double gamma,
               double min_depth, bool has_slack)
      : matrix(/*colordered=*/false, 0, 0) {
    const int tau = 3 * (problem.num_points + problem.num_frames);
    matrix.setDimensions(0, has_slack ? tau + 1 : tau);
    for (const Observation& o : problem.observations) {
      const View& view = problem.views[o.view];
      // Row a'x >= b - slack tau, from a' x_cam >= b.
      const auto add = [&](const Vector3d& a, double b, double slack) {
        CoinPackedVector row;
        const Vector3d of_point = view.cam_from_world_rotation.transpose() * a;
        const Vector3d of_frame = view.cam_from_rig_rotation.transpose() * a;
        for (int k = 0; k < 3; ++k) {
          row.insert(3 * o.point + k, of_point[k]);
          row.insert(3 * (problem.num_points + view.frame) + k, of_frame[k]);
        }
        if (has_slack && slack != 0) row.insert(tau, slack);
        matrix.appendRow(row);
        lower.push_back(b - a.dot(view.cam_from_rig_translation));
      };
      add(o.E.row(0).transpose(), min_depth, 0);
      for (const Vector2d& v : DualVertices(norm)) {
        add(o.E.transpose() * Vector3d(gamma, -v[0], -v[1]), 0, 1);
      }
    }
  }

  CoinPackedMatrix matrix;
  std::vector<double> lower;
};

// Whether all residuals can be gamma or less.
class Feasibility {
 public:
  Feasibility(const KnownRotationProblem& problem, Norm norm, double min_depth)
      : problem_(problem), norm_(norm), min_depth_(min_depth) {}

  bool operator()(double gamma) const {
    const int tau = 3 * (problem_.num_points + problem_.num_frames);
    const ResidualRows rows(problem_, norm_, gamma, min_depth_, true);
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
    model.loadProblem(rows.matrix, lower.data(), upper.data(), objective.data(),
                      rows.lower.data(), nullptr);
    model.dual();
    return model.isProvenOptimal() && model.objectiveValue() <= 10 * kTolerance;
  }

 private:
  const KnownRotationProblem& problem_;
  const Norm norm_;
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

std::optional<double> LargestByLp(const KnownRotationProblem& problem,
                                  Norm norm, double bound,
                                  const std::vector<double>& h,
                                  const std::vector<double>& e, double kept) {
  ResidualRows rows(problem, norm, bound, 0, false);
  std::vector<double> row_upper(rows.lower.size(), COIN_DBL_MAX);
  if (!e.empty()) {
    CoinPackedVector row;
    for (size_t n = 0; n < e.size(); ++n) {
      if (e[n] != 0) row.insert(static_cast<int>(n), e[n]);
    }
    rows.matrix.appendRow(row);
    rows.lower.push_back(kept);
    row_upper.push_back(kept);
  }
  std::vector<double> lower(h.size(), -COIN_DBL_MAX);
  std::vector<double> upper(h.size(), COIN_DBL_MAX);
  const auto fix = [&](int first, const Vector3d& x) {
    for (int k = 0; k < 3; ++k) lower[first + k] = upper[first + k] = x[k];
  };
  for (int k = 0; k < problem.num_points; ++k) {
    if (problem.IsFixedPoint(k)) fix(3 * k, *problem.fixed_points[k]);
  }
  for (int f = 0; f < problem.num_frames; ++f) {
    if (!problem.IsFixedFrame(f)) continue;
    fix(3 * (problem.num_points + f), *problem.fixed_translations[f]);
  }
  std::vector<double> objective;
  for (const double value : h) objective.push_back(-value);
  ClpSimplex model;
  model.setLogLevel(0);
  model.setPrimalTolerance(kTolerance);
  model.setDualTolerance(kTolerance);
  model.loadProblem(rows.matrix, lower.data(), upper.data(), objective.data(),
                    rows.lower.data(), row_upper.data());
  model.primal();
  if (!model.isProvenOptimal()) return std::numeric_limits<double>::infinity();
  return -model.objectiveValue();
}

}  // namespace krot::internal

#else

namespace krot::internal {

std::optional<double> OptimalCostByBisection(const KnownRotationProblem&, Norm,
                                             double, double) {
  return std::nullopt;
}

std::optional<double> LargestByLp(const KnownRotationProblem&, Norm, double,
                                  const std::vector<double>&,
                                  const std::vector<double>&, double) {
  return std::nullopt;
}

}  // namespace krot::internal

#endif
