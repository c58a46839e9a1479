#include "krot/minimax/kernels.h"

#include <cmath>

namespace krot::internal::KROT_UNITS {
namespace {

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

// v and w of [Zhang18, (2)].
struct Lane {
  double v1, v2, w;
};

inline Lane EvaluateLane(const double (&row)[kResidualRow][kLanes], int k,
                         const double x[3]) {
  return {row[0][k] * x[0] + row[1][k] * x[1] + row[2][k] * x[2] + row[3][k],
          row[4][k] * x[0] + row[5][k] * x[1] + row[6][k] * x[2] + row[7][k],
          row[8][k] * x[0] + row[9][k] * x[1] + row[10][k] * x[2] + row[11][k]};
}

template <typename NormFunction>
double Evaluate(const ResidualBlock* blocks, int64_t num_blocks,
                NormFunction norm, const double point[3], double* values) {
  const double x[3] = {point[0], point[1], point[2]};  // not aliased by values
  double largest[kLanes] = {};
  for (int64_t block = 0; block < num_blocks; ++block) {
    const auto& row = blocks[block].row;
    double* value = values + block * kLanes;
    for (int k = 0; k < kLanes; ++k) {
      const Lane lane = EvaluateLane(row, k, x);
      const double r = norm(lane.v1, lane.v2) / lane.w;  // (2)
      value[k] = lane.w > 0 ? r : HUGE_VAL;
      largest[k] = largest[k] < value[k] ? value[k] : largest[k];
    }
  }
  double result = 0;
  for (int k = 0; k < kLanes; ++k) {
    result = result < largest[k] ? largest[k] : result;
  }
  return result;
}

double EvaluateResiduals(const ResidualBlock* blocks, int64_t num_blocks,
                         double p, const double x[3], double* values) {
  if (p == 2) return Evaluate(blocks, num_blocks, NormL2(), x, values);
  if (p == 1) return Evaluate(blocks, num_blocks, NormL1(), x, values);
  if (p == HUGE_VAL) {
    return Evaluate(blocks, num_blocks, NormLInf(), x, values);
  }
  return Evaluate(blocks, num_blocks, NormLp{p}, x, values);
}

void EvaluateGradients(const ResidualBlock* blocks, int64_t num_blocks,
                       const double x[3], GradientBlock* gradients) {
  for (int64_t block = 0; block < num_blocks; ++block) {
    const auto& row = blocks[block].row;
    GradientBlock result;
    for (int k = 0; k < kLanes; ++k) {
      const Lane lane = EvaluateLane(row, k, x);
      const double n = NormL2()(lane.v1, lane.v2);
      const double w_inverse = 1 / lane.w;
      const double n_inverse = n > 0 ? 1 / n : 0;
      const double s1 = lane.v1 * n_inverse;
      const double s2 = lane.v2 * n_inverse;
      const double value = n * w_inverse;
      result.value[k] = value;
      result.depth[k] = lane.w;
      result.curvature[k] = n_inverse * w_inverse;
      for (int j = 0; j < 3; ++j) {  // A's_perp, (A's - r c) / w
        result.bend[j][k] = row[4 + j][k] * s1 - row[j][k] * s2;
        result.gradient[j][k] =
            (row[j][k] * s1 + row[4 + j][k] * s2 - value * row[8 + j][k]) *
            w_inverse;
      }
    }
    gradients[block] = result;
  }
}

double DepthShare(const ResidualBlock* blocks, int64_t num_blocks,
                  const double x[3], const double d[3]) {
  double result = 1;
  for (int64_t block = 0; block < num_blocks; ++block) {
    const auto& row = blocks[block].row;
    double fall[kLanes];
    double room[kLanes];
    int num_too_far = 0;
    for (int k = 0; k < kLanes; ++k) {
      fall[k] = -(row[8][k] * d[0] + row[9][k] * d[1] + row[10][k] * d[2]);
      room[k] = kLargestFall * EvaluateLane(row, k, x).w;
      num_too_far += room[k] < fall[k];
    }
    if (num_too_far == 0) continue;
    for (int k = 0; k < kLanes; ++k) {
      const double share = room[k] < fall[k] ? room[k] / fall[k] : 1;
      result = share < result ? share : result;
    }
  }
  return result;
}

void SumMetric(const ResidualBlock* blocks, int64_t num_blocks,
               const double x[3], double cost, double metric[6]) {
  double sums[6][kLanes] = {};
  for (int64_t block = 0; block < num_blocks; ++block) {
    const auto& row = blocks[block].row;
    double share[kLanes];
    double growth[kLanes];
    for (int k = 0; k < kLanes; ++k) {
      const double w = EvaluateLane(row, k, x).w;
      share[k] = 1 / (w * w);
      growth[k] = cost * cost * share[k];
    }
    int entry = 0;
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j, ++entry) {
        for (int k = 0; k < kLanes; ++k) {
          sums[entry][k] += share[k] * (row[i][k] * row[j][k] +
                                        row[4 + i][k] * row[4 + j][k]) +
                            growth[k] * row[8 + i][k] * row[8 + j][k];
        }
      }
    }
  }
  for (int entry = 0; entry < 6; ++entry) {
    metric[entry] = 0;
    for (const double sum : sums[entry]) metric[entry] += sum;
  }
}

}  // namespace

extern const ResidualKernels kResidualKernels = {
    &EvaluateResiduals, &EvaluateGradients, &DepthShare, &SumMetric};

}  // namespace krot::internal::KROT_UNITS
