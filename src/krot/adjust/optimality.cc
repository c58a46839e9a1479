#include "krot/adjust/optimality.h"

#include <vector>

#include <ceres/crs_matrix.h>

namespace krot {

std::optional<double> Stationarity(int num_threads, double cost,
                                   ceres::Problem* problem) {
  ceres::Problem::EvaluateOptions options;
  options.num_threads = num_threads;
  std::vector<double> gradient;
  ceres::CRSMatrix jacobian;
  if (!problem->Evaluate(options, nullptr, nullptr, &gradient, &jacobian)) {
    return std::nullopt;
  }
  if (cost <= 0) return 0.0;
  std::vector<double> diagonal(gradient.size(), 0.0);
  for (size_t i = 0; i < jacobian.values.size(); ++i) {
    diagonal[jacobian.cols[i]] += jacobian.values[i] * jacobian.values[i];
  }
  double sum = 0;
  for (size_t j = 0; j < gradient.size(); ++j) {
    if (diagonal[j] > 0) sum += gradient[j] * gradient[j] / diagonal[j];
  }
  return sum / (2 * cost);
}

}  // namespace krot
