#include "tools/benchmark/rivals/proximal_operator.h"

#include <algorithm>

namespace krot::internal {

void ApplyMaxNormProx(double rho, std::vector<Eigen::Vector2d>* a) {
  double high = 0;
  for (const Eigen::Vector2d& vector : *a) high = std::max(high, vector.norm());
  double low = 0;
  const auto excess = [a](double t) {
    double sum = 0;
    for (const Eigen::Vector2d& vector : *a) {
      sum += std::max(0.0, vector.norm() - t);
    }
    return sum;
  };
  if (excess(0) <= 1 / rho) high = 0;
  while (high - low > 1e-12 * high) {
    const double middle = (low + high) / 2;
    if (middle <= low || middle >= high) break;
    (excess(middle) > 1 / rho ? low : high) = middle;
  }
  for (Eigen::Vector2d& vector : *a) {
    const double norm = vector.norm();
    if (norm > high) vector *= high / norm;
  }
}

}  // namespace krot::internal
