#pragma once

#include <algorithm>
#include <cmath>
#include <random>

#include "krot/conic/cones.h"

namespace krot {

// Random vectors of a cone's space.
template <typename Cone>
class ConeGenerator {
 public:
  using Vector = typename Cone::Vector;

  explicit ConeGenerator(unsigned seed) : generator_(seed) {}

  // Each entry uniform in [-1, 1].
  Vector Direction() {
    Vector d;
    for (double& entry : d) entry = uniform_(generator_);
    return d;
  }

  // Inside the cone; the smallest eigenvalue is `margin`, the others up to 2
  // larger, and all are multiplied by 10^decade.
  Vector Inside(double margin, double decade) {
    Vector x = Direction();
    x += (margin - Cone::SmallestEigenvalue(x)) * Cone::Identity();
    return std::pow(10, decade) * x;
  }

 private:
  std::mt19937 generator_;
  std::uniform_real_distribution<double> uniform_{-1, 1};
};

}  // namespace krot
