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
#include "krot/base/context.h"

namespace krot::internal {

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

// Adds every observation of `blocks`, in their order, and every known position
// and distance to a problem that does not own the loss, and makes constant what
// the options do not refine. `loss` may be null. The blocks are solved in place
// and must outlive the problem.
void BuildAdjustmentProblem(const BundleAdjustmentOptions& options,
                            ceres::LossFunction* loss, AdjustmentBlocks* blocks,
                            ceres::Problem* problem);
// The known positions and distances, which weigh in full, whatever the loss.
void AddSurveyBlocks(AdjustmentBlocks* blocks, ceres::Problem* problem);

// The options for such a problem, which does not own the loss.
ceres::Problem::Options AdjustmentProblemOptions();

// Points are eliminated first; the linear solver depends on the number of
// images.
ceres::Solver::Options AdjustmentSolverOptions(
    const BundleAdjustmentOptions& options, const Context& context,
    AdjustmentBlocks* blocks, const ceres::Problem& problem);

// The power of two nearest to the median distance of points from their first
// frames, and all lengths of `blocks` divided by such a unit, exactly. Ceres
// adds at least 1e-6 over the radius to the diagonal of J'J, which is little
// only where lengths are neither tiny nor huge.
double UnitOfLength(const AdjustmentBlocks& blocks, const Context& context);
void DivideLengths(double unit, AdjustmentBlocks* blocks);

// g' D^-1 g / (2 cost), with the loss: g is the gradient of the cost by the
// unknowns that move, and D the diagonal of J'J, so that g_j^2 / (2 D_j) is the
// gain of moving unknown j alone, to first order. 0 at a stationary point and
// where the cost is 0. Independent of the units of the unknowns. Memory: one
// Jacobian.
std::optional<double> Stationarity(int num_threads, double cost,
                                   ceres::Problem* problem);

// Reports every iteration of solves that follow each other to the caller, and
// ends them if that is asked for.
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
    if (callback_ && (summary.iteration > 0 || num_iterations_ == 0)) {
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
  double cost_ = 0;  // at the current estimate
};

}  // namespace krot::internal
