#pragma once

#include <cmath>
#include <limits>

namespace krot {

// The p of ||.||_p, 1 <= p <= infinity.
struct Norm {
  double p = 2;

  static constexpr Norm L1() { return {1}; }
  static constexpr Norm L2() { return {2}; }
  static constexpr Norm LInf() {
    return {std::numeric_limits<double>::infinity()};
  }
};

}  // namespace krot
