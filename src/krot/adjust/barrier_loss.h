#pragma once

#include <cmath>

#include <ceres/loss_function.h>

namespace krot {

// What all observations of a bounded adjustment share.
struct Barrier {
  double cap2 = 0;  // the cap, squared; pixels^2
  double mu = 0;    // the barrier's weight; pixels^2
};

// Half of s - 2 mu log(1 - s / cap2) is the cost of a squared error s < cap2
// with its logarithmic barrier
//
//   s / 2 - mu log(h) + const,  h = (cap2 - s) / 2,
//
// and mu / h the multiplier of the constraint h >= 0 at the barrier's minimum.
// The slope is that of the barrier; the curvature is the primal-dual method's,
// lambda / h in place of mu / h^2, so that a step is Newton's for the
// perturbed optimality conditions, lambda h = mu, also where lambda is not yet
// mu / h [Nocedal, Wright 2006, Sec. 19.1].
class BarrierLoss final : public ceres::LossFunction {
 public:
  explicit BarrierLoss(const Barrier* barrier) : barrier_(barrier) {}

  double Slack(double squared_error) const {
    return (barrier_->cap2 - squared_error) / 2;
  }

  double multiplier() const { return lambda_; }
  void set_multiplier(double lambda) { lambda_ = lambda; }

  void Evaluate(double squared_error, double rho[3]) const override {
    const double h = Slack(squared_error);
    const double mu = barrier_->mu;
    rho[0] =
        squared_error - 2 * mu * std::log1p(-squared_error / barrier_->cap2);
    rho[1] = 1 + mu / h;
    rho[2] = lambda_ / (2 * h);
  }

 private:
  const Barrier* barrier_;
  double lambda_ = 0;
};

}  // namespace krot
