#pragma once

#include <cstdint>
#include <random>

#include <Eigen/Core>

namespace krot::internal {

// Random numbers that are the same on every platform: the engine's bits are
// fixed by the C++ standard, and the distributions (which the standard leaves
// to each library) are our own.
class Random {
 public:
  explicit Random(uint64_t seed) : engine_(seed) {}

  // In [0, 1), on the grid of 2^-53.
  double Uniform();
  // In [low, high).
  double Uniform(double low, double high);
  // In [0, count); requires 1 <= count < 2^53.
  int64_t UniformInt(int64_t count);
  // Standard normal, by the polar method of Marsaglia and Bray (1964).
  double Gaussian();
  // Independent standard normals.
  Eigen::Vector3d GaussianVector();
  // True with the given probability.
  bool Chance(double probability);

 private:
  std::mt19937_64 engine_;
};

}  // namespace krot::internal
