#pragma once

#include <cmath>

namespace krot {

// The logarithm of a product of numbers in [1e-100, 1], with one logarithm for
// many of them.
class LogProduct {
 public:
  LogProduct() = default;
  explicit LogProduct(double factor) : product_(factor) {}

  LogProduct Times(const LogProduct& other) const {
    LogProduct all(product_ * other.product_);
    all.log_ = log_ + other.log_;
    if (all.product_ < kSmallest) {
      all.log_ += std::log(all.product_);
      all.product_ = 1;
    }
    return all;
  }
  double Log() const { return log_ + std::log(product_); }

 private:
  static constexpr double kSmallest = 1e-100;

  double product_ = 1;
  double log_ = 0;
};

}  // namespace krot
