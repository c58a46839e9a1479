#pragma once

#include <cmath>

#include <ceres/loss_function.h>

namespace krot {

// s - 2 mu log(1 - s / cap^2) of a squared error s < cap^2, so that half its
// sum is the cost plus the logarithmic barrier of weight mu. At the minimum for
// a mu the multiplier of s / 2 <= cap^2 / 2 is 2 mu / (cap^2 - s).
class BarrierLoss final : public ceres::LossFunction {
 public:
  explicit BarrierLoss(double cap) : cap2_(cap * cap) {}

  void set_mu(double mu) { mu_ = mu; }

  double Multiplier(double squared_error) const {
    return 2 * mu_ / (cap2_ - squared_error);
  }

  void Evaluate(double squared_error, double rho[3]) const override {
    const double slack = cap2_ - squared_error;
    rho[0] = squared_error - 2 * mu_ * std::log1p(-squared_error / cap2_);
    rho[1] = 1 + 2 * mu_ / slack;
    rho[2] = 2 * mu_ / (slack * slack);
  }

 private:
  double cap2_;
  double mu_ = 0;
};

}  // namespace krot
