#pragma once

#include <functional>
#include <optional>

#include <ceres/cost_function.h>
#include <ceres/iteration_callback.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>
#include <Eigen/Core>

#include "krot/adjust/adjustment_blocks.h"
#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/timer.h"

namespace krot {

// Reprojection error, projected minus measured, in pixels. Blocks: point (3),
// rig_from_world (7), sensor_from_rig (7; only with a sensor), camera.
//
//   x_cam = sensor_from_rig (rig_from_world x)
//
// Evaluation fails, and Ceres rejects the step, where x_cam is not in front of
// the camera or has no finite pixel.
class ReprojectionCost final : public ceres::CostFunction {
 public:
  // Throws std::invalid_argument if there is no such camera model.
  ReprojectionCost(int camera_model, bool has_sensor,
                   const Eigen::Vector2d& pixel);

  bool Evaluate(double const* const* blocks, double* residuals,
                double** jacobians) const override;

 private:
  Eigen::Vector2d pixel_;
  int camera_model_;
};

// Adds every observation of `blocks` to a problem that does not own the loss,
// in their order, and holds still what the options do. `loss` may be null. The
// blocks are solved in place and must outlive the problem.
void BuildAdjustmentProblem(const BundleAdjustmentOptions& options,
                            ceres::LossFunction* loss, AdjustmentBlocks* blocks,
                            ceres::Problem* problem);

// What such a problem does not own.
ceres::Problem::Options AdjustmentProblemOptions();

// Points are eliminated first; the rest is chosen by the number of images.
ceres::Solver::Options AdjustmentSolverOptions(
    const BundleAdjustmentOptions& options, const Context& context,
    AdjustmentBlocks* blocks, const ceres::Problem& problem);

// g' D^-1 g / (2 cost), loss included: g is the gradient of the cost by what
// may move and D the diagonal of J'J, so that g_j^2 / (2 D_j) is what moving
// unknown j alone gains, to first order. 0 at a stationary point and where the
// cost is 0. Invariant to the units of the unknowns. Memory: one Jacobian.
std::optional<double> Stationarity(int num_threads, double cost,
                                   ceres::Problem* problem);

// Tells the caller of every iteration, and ends a solve that is cancelled.
class IterationObserver final : public ceres::IterationCallback {
 public:
  using Callback = std::function<void(const BundleAdjustmentIteration&)>;

  IterationObserver(const Callback& callback, const Context& context)
      : callback_(callback), context_(context) {}

  // Without the start.
  int num_iterations() const { return num_iterations_; }

  ceres::CallbackReturnType operator()(
      const ceres::IterationSummary& summary) override {
    if (summary.iteration > 0) ++num_iterations_;
    if (summary.step_is_successful || summary.iteration == 0) {
      cost_ = summary.cost;
    }
    if (callback_) {
      BundleAdjustmentIteration iteration;
      iteration.iteration = num_iterations_;
      iteration.cost = cost_;
      iteration.radius = summary.trust_region_radius;
      iteration.is_successful = summary.step_is_successful;
      iteration.seconds = timer_.Seconds();
      callback_(iteration);
    }
    return context_.IsCancelled() ? ceres::SOLVER_TERMINATE_SUCCESSFULLY
                                  : ceres::SOLVER_CONTINUE;
  }

 private:
  const Callback callback_;
  const Context context_;
  const Timer timer_;
  int num_iterations_ = 0;
  double cost_ = 0;  // where the solve is
};

}  // namespace krot
