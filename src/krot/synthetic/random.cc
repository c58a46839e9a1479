#include "krot/synthetic/random.h"

#include <cmath>

namespace krot::internal {

double Random::Uniform() {
  return static_cast<double>(engine_() >> 11) * 0x1p-53;
}

double Random::Uniform(double low, double high) {
  return low + (high - low) * Uniform();
}

int64_t Random::UniformInt(int64_t count) {
  return static_cast<int64_t>(Uniform() * static_cast<double>(count));
}

double Random::Gaussian() {
  while (true) {
    const double x = Uniform(-1, 1);
    const double y = Uniform(-1, 1);
    const double s = x * x + y * y;
    if (s > 0 && s < 1) return x * std::sqrt(-2 * std::log(s) / s);
  }
}

Eigen::Vector3d Random::GaussianVector() {
  const double x = Gaussian();
  const double y = Gaussian();
  const double z = Gaussian();
  return {x, y, z};
}

bool Random::Chance(double probability) { return Uniform() < probability; }

}  // namespace krot::internal
