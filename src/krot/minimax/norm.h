#pragma once

#include <limits>

namespace krot {

// The p of ||.||_p; 1 <= p <= infinity.
struct Norm {
  double p = 2;

  static constexpr Norm L1() { return {1}; }
  static constexpr Norm L2() { return {2}; }
  static constexpr Norm LInf() {
    return {std::numeric_limits<double>::infinity()};
  }

  // Whether ||v||_p is a maximum of linear functions of v: p = 1, infinity.
  constexpr bool IsPolyhedral() const {
    return p == 1 || p == std::numeric_limits<double>::infinity();
  }
};

}  // namespace krot
