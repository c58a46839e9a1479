#pragma once

#include <algorithm>
#include <vector>

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <Eigen/Core>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/bundle_adjustment.h"
#include "krot/adjust/ceres_problem.h"
#include "krot/model.h"

namespace krot::internal {

// The term of an augmented Lagrangian for s = |r|^2 <= cap^2, of multiplier
// lambda: max(0, lambda + c (s - cap^2) / 2)^2 / c.
class CapPenalty final : public ceres::LossFunction {
 public:
  CapPenalty(double cap, double penalty)
      : cap2_(cap * cap), penalty_(penalty) {}

  void Evaluate(double s, double rho[3]) const override {
    const double t = Multiplier(s);
    rho[0] = t * t / penalty_;
    rho[1] = t;
    rho[2] = t > 0 ? penalty_ / 2 : 0;
  }
  void Update(double s) { lambda_ = Multiplier(s); }

 private:
  double Multiplier(double s) const {
    return std::max(0.0, lambda_ + penalty_ * (s - cap2_) / 2);
  }

  const double cap2_;
  const double penalty_;
  double lambda_ = 0;
};

struct LagrangianEnd {
  double cost;  // half the sum of squared errors
  double max_error;
};

// The method of multipliers [Hestenes 1969] on Ceres, from outside the cap,
// which shares neither steps nor barrier with ours.
inline LagrangianEnd MinimizeByMultipliers(
    const Model& start, const BundleAdjustmentOptions& what_moves, double cap,
    double penalty) {
  AdjustmentBlocks blocks = MakeAdjustmentBlocks(start, 2);
  ceres::Problem problem(AdjustmentProblemOptions());
  BuildAdjustmentProblem(what_moves, nullptr, &blocks, &problem);
  std::vector<ceres::ResidualBlockId> ids;
  problem.GetResidualBlocks(&ids);
  std::vector<CapPenalty> penalties(ids.size(), CapPenalty(cap, penalty));
  for (size_t i = 0; i < ids.size(); ++i) {
    std::vector<double*> parameters;
    problem.GetParameterBlocksForResidualBlock(ids[i], &parameters);
    problem.AddResidualBlock(
        const_cast<ceres::CostFunction*>(
            problem.GetCostFunctionForResidualBlock(ids[i])),
        &penalties[i], parameters);
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.max_num_iterations = 200;
  options.function_tolerance = 1e-14;
  options.logging_type = ceres::SILENT;
  LagrangianEnd end{};
  for (int round = 0; round < 30; ++round) {
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    end = {};
    for (size_t i = 0; i < ids.size(); ++i) {
      double cost = 0;
      Eigen::Vector2d r;
      problem.EvaluateResidualBlock(ids[i], false, &cost, r.data(), nullptr);
      penalties[i].Update(r.squaredNorm());
      end.cost += cost;
      end.max_error = std::max(end.max_error, r.norm());
    }
  }
  return end;
}

}  // namespace krot::internal
