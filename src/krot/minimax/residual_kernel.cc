#include "krot/minimax/residual_kernel.h"

#include <cmath>
#include <limits>

namespace krot {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct NormL2 {
  double operator()(double v1, double v2) const {
    return std::sqrt(v1 * v1 + v2 * v2);
  }
};
struct NormL1 {
  double operator()(double v1, double v2) const {
    return std::abs(v1) + std::abs(v2);
  }
};
struct NormLInf {
  double operator()(double v1, double v2) const {
    const double a1 = std::abs(v1);
    const double a2 = std::abs(v2);
    return a1 > a2 ? a1 : a2;
  }
};
struct NormLp {
  double p;
  double operator()(double v1, double v2) const {
    const double largest = NormLInf()(v1, v2);
    if (!(largest > 0)) return largest;
    return largest * std::pow(std::pow(std::abs(v1) / largest, p) +
                                  std::pow(std::abs(v2) / largest, p),
                              1 / p);
  }
};

template <typename NormFunction>
double Evaluate(const ResidualBlock* blocks, int64_t num_blocks,
                NormFunction norm, const double x[3], double* values) {
  const double x0 = x[0];
  const double x1 = x[1];
  const double x2 = x[2];
  double largest[kResidualLanes] = {};
  for (int64_t block = 0; block < num_blocks; ++block) {
    const auto& row = blocks[block].row;
    double* value = values + block * kResidualLanes;
    for (int k = 0; k < kResidualLanes; ++k) {
      const double v1 =
          row[0][k] * x0 + row[1][k] * x1 + row[2][k] * x2 + row[3][k];
      const double v2 =
          row[4][k] * x0 + row[5][k] * x1 + row[6][k] * x2 + row[7][k];
      const double w =
          row[8][k] * x0 + row[9][k] * x1 + row[10][k] * x2 + row[11][k];
      const double r = norm(v1, v2) / w;  // (2)
      value[k] = w > 0 ? r : kInfinity;
      largest[k] = largest[k] < value[k] ? value[k] : largest[k];
    }
  }
  double result = 0;
  for (int k = 0; k < kResidualLanes; ++k) {
    result = result < largest[k] ? largest[k] : result;
  }
  return result;
}

}  // namespace

double EvaluateResiduals(const ResidualBlock* blocks, int64_t num_blocks,
                         double p, const double x[3], double* values) {
  if (p == 2) return Evaluate(blocks, num_blocks, NormL2(), x, values);
  if (p == 1) return Evaluate(blocks, num_blocks, NormL1(), x, values);
  if (p == kInfinity) {
    return Evaluate(blocks, num_blocks, NormLInf(), x, values);
  }
  return Evaluate(blocks, num_blocks, NormLp{p}, x, values);
}

}  // namespace krot
