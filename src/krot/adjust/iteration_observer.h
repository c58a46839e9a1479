#pragma once

#include <functional>

#include <ceres/iteration_callback.h>

#include "krot/adjust/bundle_adjustment.h"
#include "krot/base/timer.h"

namespace krot {

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
